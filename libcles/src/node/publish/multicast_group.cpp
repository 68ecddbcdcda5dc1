// SPDX-License-Identifier: BSL-1.0
#include "node/publish/multicast_group.hpp"

#include <cles/json_reader.hpp>
#include <cles/pending.hpp>

#include "node/membership/membership.hpp"
#include "node/security_protocol.hpp"
#include "node/session/request_checks.hpp"
#include "port/node_security.hpp"

#include <boost/system/errc.hpp>

#include <algorithm>
#include <cerrno>
#include <utility>

namespace cles::core {
namespace {

std::string cannot(const multicast_options& where, const std::string& interface) {
    return "cannot join " + where.group + ":" + std::to_string(where.port) + " on '" + interface + "': ";
}

error cannot_join(const multicast_options& where, const std::string& interface, const boost::system::error_code& why) {
    const auto reason = why == boost::system::errc::address_not_available ? "it has no IPv4 address"
                        : why == boost::system::errc::network_down        ? "it is down"
                                                                          : why.message();
    return {why, cannot(where, interface) + reason};
}

std::vector<network_interface> interfaces_or_throw(environment& by, const multicast_options& where) {
    try {
        return by.interfaces();
    } catch (const boost::system::system_error& e) {
        throw cannot_join(where, where.interface, e.code());
    }
}

} // namespace

multicast_group::multicast_group(std::shared_ptr<node_state> host, std::uint32_t seed, std::weak_ptr<void> owner)
    : node_(std::move(host)), owner_(std::move(owner)), feeds_(*node_, *this, seed),
      sources_(node_->peers, node_->bounds.publishers) {}

// -- its interfaces --------------------------------------------------------------------------------------------------

void multicast_group::join(environment& by, const multicast_options& where, bool insecure) {
    check(where);
    if (where.interface == "auto") {
        join_automatic(by, where, insecure);
    } else {
        join_all(by, where, insecure);
    }
}

void multicast_group::join(environment& by, const network_interface& interface, const multicast_options& where,
                           bool insecure) {
    if (!interface.loopback && !insecure && !node_->security) {
        throw error(errc::insecure_listen, "multicast on '" + interface.name +
                                               "' can be reached from other hosts, which are not authenticated; "
                                               "set 'insecure' to allow it");
    }
    auto port = by.join(interface, where);
    if (node_->security) {
        port = node_->security->seal(std::move(port));
    }
    const auto source = port->source();
    sessions_.emplace_back(node_, *this, std::move(port), by.random());
    interfaces_ += (interfaces_.empty() ? "" : ", ") + interface.name;
    node_->write_log(log_level::info, node_->name + " has joined " + where.group + ":" + std::to_string(where.port) +
                                          " on " + interface.name + ", sending from " + to_text(source));
}

// One interface is enough unless all are required.
void multicast_group::join_all(environment& by, const multicast_options& where, bool insecure) {
    std::vector<error> failures;
    for (const auto& name : interfaces_of(where)) {
        try {
            join(by, by.find_interface(name), where, insecure);
        } catch (const error& refused) {
            failures.push_back(refused);
        } catch (const boost::system::system_error& e) {
            failures.push_back(cannot_join(where, name, e.code()));
        }
        if (!failures.empty() && where.required) {
            throw error{failures.front()};
        }
    }
    if (sessions_.empty()) {
        throw error{failures.front()};
    }
    for (const auto& e : failures) {
        node_->write_log(log_level::warning, e.message());
    }
}

// An interface that cannot be joined was not requested by name.
void multicast_group::join_automatic(environment& by, const multicast_options& where, bool insecure) {
    std::string left_out;
    auto failure = boost::system::error_code{ENETDOWN, boost::system::system_category()};
    for (const auto& interface : automatic(interfaces_or_throw(by, where))) {
        if (sessions_.size() == multicast_options::most_interfaces) {
            left_out += (left_out.empty() ? "" : ", ") + interface.name;
            continue;
        }
        try {
            join(by, interface, where, insecure);
        } catch (const error& refused) {
            if (where.required) {
                throw;
            }
            failure = refused.code();
            node_->write_log(log_level::warning, refused.message());
        } catch (const boost::system::system_error& e) {
            failure = e.code();
            node_->write_log(log_level::warning, cannot_join(where, interface.name, failure).message());
        }
    }
    if (sessions_.empty()) {
        throw error(failure, cannot(where, where.interface) + "no interface of this host can be used");
    }
    if (!left_out.empty()) {
        node_->write_log(log_level::warning, "multicast on 'auto' uses " + interfaces_ + ", and skips " + left_out);
    }
}

void multicast_group::start() {
    for (auto& each : sessions_) {
        each.start();
    }
}

void multicast_group::stop() {
    for (auto* feed : feeds_.remove_all()) {
        if (auto waiting = feed->mail().close()) {
            node_->completions.put(completion{
                completion::event_failure{std::move(waiting), errc::stopped, "the service has been stopped"}});
        }
    }
    for (auto& each : sessions_) {
        each.stop();
    }
}

// -- what is sent ----------------------------------------------------------------------------------------------------

bool send_to(group_port& by, counters& counts, std::string_view lines) {
    if (lines.empty()) {
        return true;
    }
    const auto taken = by.send(lines);
    counts.group_sent += taken.count;
    const auto left = lines.substr(taken.bytes);
    counts.group_unsent += static_cast<std::uint64_t>(std::ranges::count(left, '\n'));
    return left.empty();
}

bool multicast_group::send(group_port& by, std::string_view line) {
    if (line.size() > protocol::datagram_bytes) {
        ++node_->counts.group_unsent;
        return false;
    }
    return send_to(by, node_->counts, line);
}

bool multicast_group::send(std::string_view line) {
    bool sent = false;
    for (auto* each : ports_) {
        sent = send(*each, line) || sent;
    }
    return sent;
}

// -- what arrives ----------------------------------------------------------------------------------------------------

bool multicast_group::is_own(const group_source& from) const noexcept {
    return std::ranges::any_of(ports_, [&](const auto* port) { return port->source() == from; });
}

bool multicast_group::is_of_this_host(const group_source& from) const noexcept {
    return from.is_loopback() ||
           std::ranges::any_of(ports_, [&](const auto* port) { return port->source().address == from.address; });
}

void multicast_group::solicited(bool by_name, time_point now) {
    if (listener_ != nullptr) {
        listener_->on_solicitation(by_name, now);
    }
}

// In a secured fleet, a member publishes under its own name, with the epoch that it has confirmed.
bool multicast_group::is_by_its_publisher(const group_datagram& datagram) const noexcept {
    const auto& update = *datagram.request;
    return !node_->security || (datagram.member == update.noun.target && datagram.epoch == update.epoch);
}

bool multicast_group::is_copy(const group_datagram& datagram) const {
    return node_->security && (!datagram.request->is_update() || datagram.request->noun.path != "cles") &&
           node_->peers.is_elsewhere(datagram.member, datagram.epoch, datagram.from);
}

bool multicast_group::take(const group_datagram& datagram, time_point now) {
    using verdict = publisher_sources::verdict;
    const auto& from = datagram.from;
    const auto& update = *datagram.request;
    const auto& noun = update.noun;
    if (!is_by_its_publisher(datagram)) {
        return false;
    }
    if (node_->secured && noun.path == load_path) {
        return datagram.accept() && node_->secured->on_load_report(from, update, now);
    }
    if (noun.task == "cles") {
        return take_announcement(datagram, now);
    }
    auto& counts = node_->counts;
    if (protocol::begins_with_error(update.body) || !feeds_.wants(update) || sources_.is_foreign(from, now) ||
        !permits(*node_, {.requester = node_->name}, noun.target, verb::bind, noun)) {
        ++counts.updates_dropped;
        return true;
    }
    const auto check = node_->secured ? node_->secured->check(update, false) : update_check::unsigned_one;
    if (check == update_check::refused) {
        ++counts.updates_unsigned;
        return true;
    }
    const auto found = sources_.look(noun.target, from, now);
    if (found == verdict::another) {
        feeds_.forget(noun.target);
    }
    if (found != verdict::refused && datagram.accept(check == update_check::signed_one) && feeds_.take(update)) {
        ++counts.updates_received;
    } else if (found == verdict::one_of_several) {
        ++counts.group_repeated;
    } else {
        ++counts.updates_dropped;
        if (std::string why;
            node_->log && !update.body.empty() && !is_valid_json(update.body, detail::answer_depth, &why)) {
            node_->log_drop(host_text(from), "an update", "its body is no JSON: " + why, true);
        }
    }
    return true;
}

// Other hosts have the same addresses on loopback.
bool multicast_group::is_from_stated_source(const group_datagram& datagram, const announcement& said) const {
    const auto& from = datagram.from;
    const auto* const run = from.is_loopback() ? node_->peers.announced(datagram.member) : nullptr;
    const bool is_of_another_host = run != nullptr && run->epoch == datagram.epoch && !is_of_this_host(run->from);
    return !is_of_another_host && std::ranges::find(said.sources, from) != said.sources.end();
}

// In a secured fleet, announcements are signed, since others pass them on. Strangers can repeat them from other
// sources, so the source is checked first, and the signature, which takes longer, after it.
bool multicast_group::take_announcement(const group_datagram& datagram, time_point now) {
    using repetition = datagram_admission::repetition;
    const auto& update = *datagram.request;
    auto& counts = node_->counts;
    if (!update.noun.parameters.empty() || !is_valid_json(update.body, node_->bounds.depth)) {
        return false;
    }
    heard_announcement heard{.said = {}, .epoch = *update.epoch, .seq = *update.seq, .from = datagram.from};
    std::string why;
    if (!read_announcement(update, heard.said, why)) {
        ++counts.announcements_dropped;
        node_->post_log(log_level::debug, "an announcement from " + host_text(heard.from) + " was dropped: " + why);
        return true;
    }
    if (const auto& security = node_->security) {
        if (!is_from_stated_source(datagram, heard.said)) {
            ++counts.group_copied;
            return true;
        }
        if (!security->is_signed(datagram.member, update.noun.path, heard.seq, protocol::epoch_text(heard.epoch),
                                 update.body, update.sig)) {
            return false;
        }
        heard.said.original = std::make_shared<signed_announcement>(
            signed_announcement{std::string{update.body}, std::string{update.sig}});
    }
    const auto found = datagram.accept_announcement(heard.seq);
    if (found == repetition::refused) {
        return false;
    }
    heard.again = found == repetition::again;
    if (listener_ != nullptr) {
        listener_->on_announcement(std::move(heard), now);
    }
    return true;
}

publisher_sources::verdict publisher_sources::look(std::string_view node, const group_source& from, time_point now) {
    if (const auto* const run = others_.announced(node)) {
        return !run->sends_from(from)               ? verdict::refused
               : run->announced.sources.size() <= 1 ? verdict::taken
                                                    : verdict::one_of_several;
    }
    if (const auto found = source_bindings_.find(node); found != source_bindings_.end()) {
        const bool same = found->second.to == from;
        if (!same && now - found->second.heard < silent_after) {
            return verdict::refused;
        }
        found->second = {from, now};
        return same ? verdict::taken : verdict::another;
    }
    if (source_bindings_.size() >= max_entries_ && !source_bindings_.empty()) {
        source_bindings_.erase(
            std::min_element(source_bindings_.begin(), source_bindings_.end(),
                             [](const auto& a, const auto& b) { return a.second.heard < b.second.heard; }));
    }
    source_bindings_.emplace(std::string{node}, source_binding{from, now});
    return verdict::taken;
}

void publisher_sources::note_foreign(const group_source& from, time_point until) {
    if (foreign_.size() >= max_entries_ && !foreign_.contains(from)) {
        foreign_.erase(std::min_element(foreign_.begin(), foreign_.end(),
                                        [](const auto& a, const auto& b) { return a.second < b.second; }));
    }
    if (max_entries_ != 0) {
        foreign_.insert_or_assign(from, until);
    }
}

} // namespace cles::core
