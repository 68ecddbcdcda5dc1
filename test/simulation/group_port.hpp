// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/group_source.hpp"
#include "simulation/network.hpp"
#include "simulation/place.hpp"

#include <cstddef>
#include <deque>
#include <memory>
#include <string>
#include <string_view>

namespace cles::simulation {

/// A node's place in the multicast group, as transport/group_port.hpp has it: hears what others send there, and sends
/// from a port of its own. The system takes a number of datagrams at once; the rest waits.
class group_port final : public std::enable_shared_from_this<group_port> {
  public:
    class events {
      public:
        events() = default;
        events(const events&) = delete;
        events& operator=(const events&) = delete;
        virtual void on_datagram(const core::group_source& from, std::string_view datagram) = 0;
        virtual void on_room() = 0;

      protected:
        ~events() = default;
    };

    group_port(network& net, const std::shared_ptr<place>& home, unsigned port)
        : net_(net), home_(home), local_{home->host(), port} {}

    /// To be called first: from now on it receives. The owner stays until `close`.
    void open(events& owner);
    void close() noexcept {
        owner_ = nullptr;
        waiting_.clear();
        unsent_ = 0;
    }
    /// False where as much waits as may.
    bool send(std::string_view line);
    [[nodiscard]] std::size_t unsent() const noexcept { return unsent_; }
    [[nodiscard]] const endpoint& local() const noexcept { return local_; }
    [[nodiscard]] core::group_source source() const noexcept { return source_of(local_); }
    void receive(const endpoint& from, const std::string& datagram);

    static constexpr std::size_t most_waiting = 1U << 16U;

  private:
    [[nodiscard]] static core::group_source source_of(const endpoint& where) noexcept;
    void pass_on(std::string_view line);
    void drain();

    network& net_;
    std::weak_ptr<place> home_;
    endpoint local_;
    events* owner_ = nullptr; // null: closed
    std::deque<std::string> waiting_;
    std::size_t unsent_ = 0;
    unsigned in_system_ = 0;
};

} // namespace cles::simulation
