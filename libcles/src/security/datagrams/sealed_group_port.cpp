// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/sealed_group_port.hpp"

#include <cles/json_reader.hpp>

#include "json/json_members.hpp"
#include "protocol/request_line.hpp"
#include "security/keys/bytes.hpp"

#include <algorithm>
#include <utility>

namespace cles::security {
namespace {

constexpr std::size_t max_unknown = 256; // members
constexpr std::size_t max_endpoints = 16;
constexpr std::size_t max_outdated = 64; // members with an old roster, which are to be told
constexpr std::size_t depth = 8;         // of an announcement

// "tls://0.0.0.0:25370", which means all addresses of the announcing node, becomes the one that it sends from.
std::string with_source(std::string_view endpoint, const core::group_source& from) {
    constexpr std::string_view unspecified = "://0.0.0.0";
    std::string out{endpoint};
    const auto at = out.find(unspecified);
    const auto end = at + unspecified.size();
    if (at != std::string::npos && (end == out.size() || out[end] == ':' || out[end] == '?')) {
        out.replace(out.find("0.0.0.0", at), std::string_view{"0.0.0.0"}.size(), core::host_text(from));
    }
    return out;
}

bool is_tls(std::string_view endpoint) { return endpoint.starts_with("tls:"); }

// Of an announcement; empty for other lines.
std::vector<std::string> endpoints_in(std::string_view line, const core::group_source& from) {
    std::vector<std::string> found;
    protocol::request_line said;
    if (!protocol::parse_group_message(line, said) || !said.is_update() || said.noun.path != "cles") {
        return found;
    }
    json_reader r{said.body, depth};
    core::read_members(r, [&](std::string_view key) {
        return key != "endpoints" ? r.skip() : core::read_texts(r, [&](std::string_view text) {
            if (found.size() < max_endpoints) {
                found.push_back(with_source(text, from));
            }
        });
    });
    return found;
}

/// Of one datagram, which it outlives.
class group_admission final : public core::datagram_admission {
  public:
    group_admission(sealed_datagrams& by, const group_receiver::ticket& ticket) noexcept : by_(by), ticket_(ticket) {}
    bool accept(bool is_signed) override {
        return by_.accept(ticket_,
                          is_signed ? group_receiver::ordered_by::signed_seq : group_receiver::ordered_by::counter);
    }
    repetition accept_announcement(std::uint64_t seq) override { return by_.accept_announcement(ticket_, seq); }

  private:
    sealed_datagrams& by_;
    const group_receiver::ticket& ticket_;
};

} // namespace

sealed_group_port::sealed_group_port(std::shared_ptr<sealed_datagrams> by, std::shared_ptr<core::group_port> port,
                                     unanswered report)
    : all_(std::move(by)), port_(std::move(port)), report_(std::move(report)), number_(all_->add(*this)),
      announcement_start_("UPDATE " + all_->members().name() + ":cles "),
      observation_(all_->observe([this](const roster&) { on_roster(); })) {}

sealed_group_port::~sealed_group_port() { sealed_group_port::close(); }

void sealed_group_port::start(core::group_listener& owner) {
    owner_ = &owner;
    port_->start(*this);
    port_->receive_own();
}

void sealed_group_port::close() {
    owner_ = nullptr;
    all_->remove(number_);
    port_->close();
}

// -- sending -------------------------------------------------------------------------------------------------------

core::datagrams_done sealed_group_port::send(core::datagram_list all) {
    sealed_.clear();
    sizes_.clear();
    core::datagrams_done lost; // lines that cannot be sealed
    for (auto rest = all; !rest.empty(); rest.drop_first()) {
        auto line = rest.first();
        line.remove_suffix(line.ends_with('\n') ? 1 : 0);
        if (line.starts_with(announcement_start_)) {
            announcement_ = line;
        }
        const auto datagram = all_->seal_for_group(line);
        sealed_.append(as_text(datagram));
        sizes_.push_back(static_cast<std::uint16_t>(datagram.size()));
    }
    if (sealed_.empty()) { // this node is not in the roster
        for (; !all.empty(); all.drop_first()) {
            ++lost.count;
            lost.bytes += all.first().size();
        }
        return lost;
    }
    const auto sent = port_->send({sealed_, sizes_});
    core::datagrams_done done{.count = sent.count, .failed = sent.failed, .why = sent.why};
    for (auto left = sent.count; left != 0; --left) {
        done.bytes += all.first().size();
        all.drop_first();
    }
    return done;
}

void sealed_group_port::on_writable() {
    if (owner_ != nullptr) {
        owner_->on_writable();
    }
}

// -- receiving -----------------------------------------------------------------------------------------------------

void sealed_group_port::on_datagram(const core::group_datagram& datagram) {
    if (owner_ == nullptr) {
        return;
    }
    if (!is_sealed(as_bytes(datagram.text))) {
        all_->count_unsealed();
        return;
    }
    if (datagram.to_group) {
        on_group(datagram);
    } else {
        all_->receive(path_of(datagram.from), as_bytes(datagram.text));
    }
}

void sealed_group_port::on_group(const core::group_datagram& datagram) {
    const auto found = all_->open_group(path_of(datagram.from), as_bytes(datagram.text));
    if (found.what == group_receiver::verdict::unknown_salt) {
        note_unknown(read_head(as_bytes(datagram.text))->sender, found.line, datagram.from);
        return;
    }
    const auto* const sender = found.what == group_receiver::verdict::opened
                                   ? all_->members().in_force().find(found.accepted_by.member)
                                   : nullptr;
    if (sender == nullptr) {
        return;
    }
    received_.insert(found.accepted_by.member);
    // Both outlive the call, in which another roster may come into force, or another datagram be opened.
    const std::string name = sender->name;
    auto line = std::exchange(line_, {});
    line.assign(found.line);
    protocol::request_line said;
    const bool good = protocol::parse_group_message(line, said);
    group_admission admission{*all_, found.accepted_by};
    owner_->on_datagram({.from = datagram.from,
                         .text = line,
                         .request = good ? &said : nullptr,
                         .member = name,
                         .epoch = found.epoch,
                         .admission = &admission});
    line_ = std::move(line);
}

// -- members with unknown salts ------------------------------------------------------------------------------------

void sealed_group_port::note_unknown(std::uint32_t member, std::string_view line, const core::group_source& from) {
    if (auto endpoints = endpoints_in(line, from); !endpoints.empty() || unknown_.contains(member)) {
        if (unknown_.size() >= max_unknown && !unknown_.contains(member)) {
            unknown_.erase(unknown_.begin());
        }
        if (!endpoints.empty()) {
            unknown_.insert_or_assign(member, std::move(endpoints));
        }
    } else if (unknown_.size() < max_unknown) {
        unknown_.try_emplace(member);
    }
}

// It is asked to announce itself: what it has announced under this salt so far was dropped. So was what this node has
// asked the group since its start, if the peer did not know its salt either.
void sealed_group_port::on_established(const datagram_source& with, std::uint32_t) {
    const auto* const peer = all_->members().in_force().find(with.member);
    const bool was_unknown = unknown_.erase(with.member) != 0;
    if ((was_unknown || !received_.contains(with.member)) && peer != nullptr) {
        static_cast<void>(send(std::string_view{"BIND " + peer->name + ":cles\n"}));
    }
    if (std::erase(outdated_, with) != 0) {
        static_cast<void>(all_->send(with, announcement_));
    }
}

// -- members with older and newer rosters --------------------------------------------------------------------------

// In a new session: the member may have restarted, and not know an earlier one.
void sealed_group_port::on_outdated(const datagram_source& outdated) {
    if (announcement_.empty()) {
        return;
    }
    if (std::ranges::find(outdated_, outdated) == outdated_.end()) {
        if (outdated_.size() >= max_outdated) {
            outdated_.erase(outdated_.begin());
        }
        outdated_.push_back(outdated);
    }
    all_->contact(outdated);
}

void sealed_group_port::on_announcement(const datagram_source& from, std::string_view line) {
    is_behind_ = true;
    if (const auto endpoints = endpoints_in(line, {.address = from.path.v4_address(), .port = from.path.port});
        report_ && std::ranges::any_of(endpoints, is_tls) && all_->may_fetch_roster(from.member)) {
        report_(from.member, endpoints);
    }
}

// The others have not been able to read what this node has asked the group, nor this node their announcements.
void sealed_group_port::on_roster() {
    if (std::exchange(is_behind_, false) && owner_ != nullptr) {
        static_cast<void>(send(std::string_view{"BIND all:cles\n"}));
    }
}

void sealed_group_port::on_gave_up(const datagram_source& with, bool) {
    std::erase(outdated_, with);
    if (const auto gone = unknown_.extract(with.member); !gone.empty() && report_) {
        report_(with.member, gone.mapped());
    }
}

void sealed_group_port::send_sealed(const datagram_path& to, bytes_view datagram) {
    if (to.is_v4()) {
        port_->send_to({.address = to.v4_address(), .port = to.port}, as_text(datagram));
    }
}

} // namespace cles::security
