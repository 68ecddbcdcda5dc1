// SPDX-License-Identifier: BSL-1.0
#include "simulation/secured/attacker.hpp"

#include "security/datagrams/datagram_format.hpp"
#include "security/datagrams/noise_kk.hpp"
#include "simulation/network/link_security.hpp"
#include "simulation/network/stream_half.hpp"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

namespace cles::simulation {
namespace {

constexpr unsigned first_host = 100;

std::string_view text_of(security::bytes_view bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

} // namespace

/// Opens a stream with a key that is in no roster, and goes on as if it were admitted.
class stranger final : public place, public link_events, private link_security {
  public:
    stranger(network& net, unsigned host, security::signing_key key)
        : place(net.time(), host, "x" + std::to_string(host)), net_(net), key_(std::move(key)) {}

    void start(unsigned to, std::string lines) {
        net_.dial(
            shared_from_this(), {to, stream_listen_port}, {},
            [this, lines = std::move(lines)](boost::system::error_code, const std::shared_ptr<stream_half>& made) {
                if (made) {
                    link_ = made;
                    link_->start(std::static_pointer_cast<stranger>(shared_from_this()));
                    link_->output() = lines;
                    link_->flush();
                }
            });
    }
    void leave() {
        if (link_) {
            link_->close();
        }
    }

    void on_line(std::string_view) override {}
    void on_overlong(std::string_view) override {}
    void on_batch() override {}
    void on_end() override { leave(); }
    void on_lost(boost::system::error_code) override {}
    void on_writable() override {}

  private:
    link_security* security() noexcept override { return this; }
    [[nodiscard]] const link_key& own_key() const override { return key_.public_part(); }
    [[nodiscard]] std::unique_ptr<stream_gate> make_gate(std::string_view) override { return nullptr; }
    [[nodiscard]] std::unique_ptr<transport::datagram_codec> make_codec() override { return nullptr; }
    [[nodiscard]] std::uint32_t number_of(std::string_view) const override { return 0; }

    network& net_;
    security::signing_key key_;
    std::shared_ptr<stream_half> link_;
};

attacker::attacker(network& net, std::uint64_t seed) : net_(net), chance_(seed) {
    net_.eavesdrop(
        [this](const endpoint& from, std::optional<endpoint> to, std::string_view bytes) { record(from, to, bytes); });
}

attacker::~attacker() { leave(); }

void attacker::record(const endpoint& from, std::optional<endpoint> to, std::string_view bytes) {
    constexpr std::size_t most = 300;
    ++seen_;
    if (memory_.size() < most) {
        memory_.push_back({from, to, std::string{bytes}});
    } else if (const auto at = chance_.below(static_cast<unsigned>(seen_)); at < most || at % 4 == 0) {
        memory_[at % most] = {from, to, std::string{bytes}};
    }
}

std::string attacker::random_bytes(std::size_t size) {
    std::string bytes(size, '\0');
    std::ranges::generate(bytes, [this] { return static_cast<char>(chance_.next()); });
    return bytes;
}

void attacker::attack(deed what, unsigned host, unsigned count, const security::roster& stolen) {
    const endpoint to{host, datagram_listen_port};
    for (; count != 0 && !memory_.empty(); --count) {
        const auto& members = stolen.members();
        const auto& as = members[chance_.below(static_cast<unsigned>(members.size()))];
        const auto old = any();
        switch (what) {
        case deed::noise: net_.inject(old.from, old.to, random_bytes(chance_.below(1300))); break;
        case deed::flipped: {
            auto bytes = old.bytes;
            bytes[chance_.below(static_cast<unsigned>(bytes.size()))] ^= static_cast<char>(1U << chance_.below(8));
            net_.inject(old.from, old.to, bytes);
            break;
        }
        case deed::headed: send_headed(host, as); break;
        case deed::repeated: net_.inject(old.from, old.to, old.bytes); break;
        case deed::redirected: {
            const auto to_group = !old.to && chance_.chance(500);
            net_.inject({old.from.host, old.from.port + chance_.below(2)}, to_group ? std::nullopt : std::optional{to},
                        old.bytes);
            break;
        }
        case deed::unsealed: {
            const auto from = old.to && old.to->host == host ? old.from : endpoint{(host + 1) % 2, 1000};
            net_.inject(from, chance_.chance(500) ? std::optional{to} : std::nullopt,
                        line_for(stolen, "n" + std::to_string(host)));
            break;
        }
        case deed::keyless: send_keyless(host, stolen, as); break;
        case deed::stream: {
            auto lines = "PUSH self:cles/hello reply=no {\"version\":" + std::to_string(stolen.version()) +
                         ",\"epoch\":\"01234567\"}\n";
            if (chance_.chance(300)) {
                lines += "PUSH self:cles/roster reply=no " + stolen.line() + "\n";
            }
            lines += "PUSH self:cles/welcome reply=no\n" + line_for(stolen, "n" + std::to_string(host));
            const auto number = first_host + static_cast<unsigned>(strangers_.size());
            strangers_.push_back(std::make_shared<stranger>(net_, number, security::signing_key::generate()));
            strangers_.back()->start(host, std::move(lines));
            return; // one is enough
        }
        }
    }
}

std::string attacker::line_for(const security::roster&, std::string_view victim) {
    const auto op = std::to_string(++last_op_);
    if (chance_.chance(500)) {
        return "UPDATE n" + std::to_string(chance_.below(4)) +
               ":fix/0 seq=9999 epoch=01234567 {\"n\":9999,\"run\":1}\n";
    }
    return "PUSH " + std::string{victim} + ":store/" + op + " id=" + op + " {\"op\":" + op + "}\n";
}

void attacker::send_headed(unsigned host, const security::member& as) {
    const endpoint from{as.name.back() - '0' + 0U, datagram_listen_port};
    const endpoint to{host, datagram_listen_port};
    std::array<std::uint8_t, security::group_head_bytes> head{};
    security::group_salt salt{};
    const auto& old = any().bytes;
    std::copy_n(old.begin(), std::min(old.size(), salt.size()), salt.begin());
    if (chance_.chance(300)) {
        security::write_group_head(as.number, chance_.between(1, 8), salt, chance_.next(), head.data());
        net_.inject(from, std::nullopt, std::string{text_of(head)} + random_bytes(200));
    } else if (chance_.chance(500)) {
        security::write_data_head(as.number, chance_.next(), chance_.below(100), head.data());
        net_.inject(from, to, std::string{text_of(head).substr(0, security::data_head_bytes)} + random_bytes(100));
    } else {
        const auto kind = chance_.chance(500) ? security::datagram_kind::hello : security::datagram_kind::welcome;
        security::write_hello_head(kind, as.number, chance_.next(), head.data());
        net_.inject(from, to,
                    std::string{text_of(head).substr(0, security::hello_head_bytes)} +
                        random_bytes(security::hello_bytes - security::hello_head_bytes));
    }
}

// A HELLO under a member's number, made with another key.
void attacker::send_keyless(unsigned host, const security::roster& stolen, const security::member& as) {
    const auto* const victim = stolen.find("n" + std::to_string(host));
    if (victim == nullptr) {
        return;
    }
    const auto key = security::signing_key::generate();
    security::noise_initiator handshake{{.secret = key.agreement_secret(),
                                         .own = chance_.chance(500) ? key.agreement_part() : as.agreement,
                                         .peer = victim->agreement},
                                        security::secret_bytes::random(32)};
    security::hello_datagram hello{};
    security::write_hello_head(security::datagram_kind::hello, as.number, chance_.next(), hello.data());
    const std::span text{hello};
    const auto head = text.first<security::hello_head_bytes>();
    if (handshake.write(
            security::hello_prologue(stolen.fleet(), victim->number, head),
            security::write_statement(0, {.roster = stolen.version(), .epoch = 1, .salt = {}, .counter = 0}),
            text.subspan(security::hello_head_bytes))) {
        net_.inject({as.name.back() - '0' + 0U, datagram_listen_port}, endpoint{host, datagram_listen_port},
                    text_of(hello));
    }
}

void attacker::repeat_all() {
    for (const auto& each : std::vector{memory_}) {
        net_.inject(each.from, each.to, each.bytes);
    }
}

void attacker::leave() {
    for (const auto& each : std::exchange(strangers_, {})) {
        each->leave();
    }
}

} // namespace cles::simulation
