// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/line_link.hpp>

#include "simulation/network/network.hpp"
#include "simulation/network/place.hpp"

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>

namespace cles::simulation {

class datagram_link;

/// A socket for datagrams: one link for each source, as in transport/udp.hpp.
class datagram_port final : public std::enable_shared_from_this<datagram_port> {
  public:
    datagram_port(network& net, const std::shared_ptr<place>& home, endpoint local, bool strangers)
        : net_(net), home_(home), local_(local), strangers_(strangers) {}

    /// Call this first: the port receives from now on.
    void open() { net_.open(local_, shared_from_this()); }
    void accept(std::function<void(link_ptr)> on_link) { on_link_ = std::move(on_link); }
    link_ptr connect(const endpoint& peer);
    void receive(const endpoint& from, const std::string& datagram);

  private:
    friend datagram_link;

    void hand_over(const endpoint& from, const std::string& datagram);
    void keep(const endpoint& source);

    network& net_;
    std::weak_ptr<place> home_;
    endpoint local_;
    bool strangers_;
    std::function<void(link_ptr)> on_link_;
    std::map<endpoint, std::weak_ptr<datagram_link>> links_;
};

/// The link to one source.
class datagram_link final : public link, public std::enable_shared_from_this<datagram_link> {
  public:
    datagram_link(std::shared_ptr<datagram_port> port, const endpoint& peer, bool stranger);

    void start(std::shared_ptr<link_events> owner) override { owner_ = std::move(owner); }
    std::string& output() override { return output_; }
    [[nodiscard]] std::size_t datagram() const noexcept override;
    void flush() override;
    [[nodiscard]] std::size_t unsent() const noexcept override { return output_.size(); }
    [[nodiscard]] std::uint64_t sent() const noexcept override { return sent_; }
    [[nodiscard]] std::uint64_t received() const noexcept override { return received_; }
    void pause(bool stop) override { paused_ = stop; }
    void finish() override;
    void close() override;
    [[nodiscard]] const identity& peer() const noexcept override { return who_; }

    void deliver(std::string_view datagram);

  private:
    std::shared_ptr<datagram_port> port_; // null once it is closed
    endpoint peer_;
    identity who_;
    std::shared_ptr<link_events> owner_;
    std::string output_;
    std::uint64_t sent_ = 0;
    std::uint64_t received_ = 0;
    bool paused_ = false;
};

} // namespace cles::simulation
