// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/datagrams/datagram_sessions.hpp"
#include "security/datagrams/group_receiver.hpp"
#include "security/datagrams/group_sender.hpp"
#include "security/fleet/fleet_authority.hpp"
#include "security/fleet_fixture.hpp"

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

/// A small network of nodes with security, in virtual time.

namespace cles::security::test {

using bytes = std::vector<std::uint8_t>;

/// A text of the test vectors.
inline std::string vector_text(std::string_view object, std::string_view key) {
    return text_at(vectors().at(object).as_object(), key);
}

/// The salt of a test vector.
class fixed_salt final : public entropy {
  public:
    explicit fixed_salt(bytes salt) : salt_(std::move(salt)) {}
    void fill(std::span<std::uint8_t> out) override { std::ranges::copy(salt_, out.begin()); }

  private:
    bytes salt_;
};

/// Repeats itself for the same seed.
class seeded_entropy final : public entropy {
  public:
    explicit seeded_entropy(std::uint64_t seed) : engine_(seed) {}
    void fill(std::span<std::uint8_t> out) override {
        for (auto& byte : out) {
            byte = static_cast<std::uint8_t>(engine_());
        }
    }

  private:
    std::mt19937_64 engine_;
};

signing_key key_from(std::uint8_t seed);

/// A fleet of cars with known keys: car1 has the number 1.
class test_fleet {
  public:
    explicit test_fleet(int cars);
    fleet_authority authority;
    /// The key of a car, also of one that is not a member.
    [[nodiscard]] static signing_key key_of(int car) { return key_from(static_cast<std::uint8_t>(car)); }
    [[nodiscard]] static std::string name_of(int car) { return "car" + std::to_string(car); }
    void add(int car);
    void remove(int car) { authority.remove(name_of(car)); }
};

class sealed_network;

/// One process of a node.
class sealed_node final : public datagram_sink {
  public:
    struct established_session {
        datagram_source with{};
        node_statement stated{};
        bool restarted = false;
    };
    struct opened_line {
        datagram_source from{};
        std::uint32_t epoch = 0;
        std::string line{};
    };

    sealed_node(sealed_network& network, const test_fleet& of, int car, datagram_path at, std::uint32_t epoch,
                datagram_limits limits = {});
    ~sealed_node();

    /// As others see it.
    [[nodiscard]] datagram_source source() const { return {.path = at, .member = number}; }
    bool send(const sealed_node& to, std::string_view line);
    bool contact(const sealed_node& with);
    void receive(const datagram_path& from, bytes_view datagram);
    [[nodiscard]] std::vector<std::string> lines() const;
    /// How often a line was opened.
    [[nodiscard]] std::size_t count(std::string_view line) const;

    sealed_network& network;
    const datagram_path at;
    const std::uint32_t number;
    const std::uint32_t epoch;
    seeded_entropy random;
    security::fleet fleet;
    group_sender group;
    group_receiver group_in;
    datagram_sessions sessions;
    std::vector<established_session> established_log;
    std::vector<opened_line> opened_log;
    std::vector<datagram_source> gave_up_log;
    std::vector<hello_refusal> refused_log;
    std::vector<bool> lost_log;                        ///< whether there was no earlier session
    std::optional<datagram_source> held;               ///< see `datagram_sink::holds`
    std::function<void(const opened_line&)> on_opened; ///< may be empty

  private:
    void send(const datagram_path& to, bytes_view datagram) override;
    [[nodiscard]] node_statement statement() override;
    void established(const datagram_source& with, const node_statement& stated, bool restarted) override;
    void opened(const datagram_source& from, std::uint32_t epoch, std::string_view line) override;
    void gave_up(const datagram_source& with, bool lost) override {
        gave_up_log.push_back(with);
        lost_log.push_back(lost);
    }
    void refused(const datagram_source&, hello_refusal why) override { refused_log.push_back(why); }
    [[nodiscard]] bool holds(const datagram_source& which) const override { return held == which; }
};

/// Delivers datagrams after a delay, loses and repeats some, and runs the nodes' timers.
class sealed_network {
  public:
    struct datagram {
        datagram_path from{};
        datagram_path to{};
        bytes content{};
    };
    struct faults {
        double loss = 0;
        double repetition = 0;
        std::chrono::milliseconds longest_delay{1}; ///< beyond 1 ms, datagrams overtake each other
    };

    explicit sealed_network(std::uint64_t seed = 1) : random(seed) {}

    void carry(datagram d);
    /// Delivers what is due and runs timers until then.
    void run_until(time_point end);
    void run(std::chrono::nanoseconds span) { run_until(now + span); }

    [[nodiscard]] std::size_t count(datagram_kind kind) const;

    time_point now{std::chrono::hours{1}};
    faults with{};
    std::mt19937_64 random;
    std::vector<datagram> sent; ///< everything, in order
    /// Returns whether to drop a datagram; may be empty.
    std::function<bool(const datagram&)> drop;

  private:
    friend sealed_node;

    std::vector<sealed_node*> nodes_;
    std::multimap<time_point, datagram> under_way_;
};

} // namespace cles::security::test
