// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/line_link.hpp>

#include "simulation/network/network.hpp"
#include "simulation/network/place.hpp"
#include "transport/datagram_codec.hpp"

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>

namespace cles::simulation {

class datagram_link;

/// Who sends datagrams: a host and port, and with security also a member.
struct datagram_peer {
    endpoint at;
    std::uint32_t member = 0;

    auto operator<=>(const datagram_peer&) const = default;
};

/// A socket for datagrams: one link for each source, as in transport/udp.hpp.
class datagram_port final : public std::enable_shared_from_this<datagram_port>,
                            private transport::datagram_codec::carrier {
  public:
    /// \param codec null: without security
    datagram_port(network& net, const std::shared_ptr<place>& home, endpoint local, bool strangers,
                  std::unique_ptr<transport::datagram_codec> codec = nullptr);
    ~datagram_port();

    /// Call this first: the port receives from now on.
    void open() { net_.open(local_, shared_from_this()); }
    void accept(std::function<void(link_ptr)> on_link) { on_link_ = std::move(on_link); }
    /// \param member its number; 0: without security
    link_ptr connect(const endpoint& peer, std::uint32_t member = 0);
    void receive(const endpoint& from, const std::string& datagram);
    /// The process has ended: nothing is sent or received any more.
    void end();

  private:
    friend datagram_link;

    void hand_over(const endpoint& from, const std::string& datagram);
    void keep(const datagram_peer& source);
    void send(const datagram_peer& to, std::string_view line);
    [[nodiscard]] std::shared_ptr<datagram_link> find(const datagram_peer& from) const;
    std::shared_ptr<datagram_link> accept(const datagram_peer& from);
    void deliver(const datagram_peer& from, std::uint32_t epoch, std::string_view line);
    void take_forgery(const endpoint& from, std::string_view datagram);

    // With security.
    using udp_endpoint = transport::datagram_codec::endpoint;
    void transmit(const udp_endpoint& to, std::string_view datagram) override;
    void on_opened(const transport::datagram_origin& from, std::uint32_t epoch, std::string_view line) override;
    void on_established(const transport::datagram_origin& with, std::uint32_t epoch) override;
    void on_unanswered(const transport::datagram_origin& with, bool lost) override;
    void on_removed(std::uint32_t member) override;
    [[nodiscard]] bool holds(const transport::datagram_origin& which) const override;

    network& net_;
    std::weak_ptr<place> home_;
    endpoint local_;
    std::string name_; // in the trace
    bool strangers_;
    std::function<void(link_ptr)> on_link_;
    bool dialled_ = false;
    std::map<datagram_peer, std::weak_ptr<datagram_link>> links_;
    std::unique_ptr<transport::datagram_codec> codec_;
    std::string_view raw_;                                               // what is being received
    std::map<std::string, std::pair<datagram_peer, std::string>> taken_; // by a planted fault: what was opened
};

/// The link to one source.
class datagram_link final : public link, public std::enable_shared_from_this<datagram_link> {
  public:
    datagram_link(std::shared_ptr<datagram_port> port, const datagram_peer& peer, bool stranger);

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
    [[nodiscard]] std::string_view epoch() const noexcept override { return epoch_; }
    void check_peer(time_point since) override;

    void deliver(std::string_view datagram);
    /// Whether the peer had stated another epoch.
    bool note_epoch(std::uint32_t epoch);
    /// Ends, and tells its owner.
    void lose();
    [[nodiscard]] const std::shared_ptr<link_events>& owner() const noexcept { return owner_; }

  private:
    std::shared_ptr<datagram_port> port_; // null once it is closed
    datagram_peer peer_;
    identity who_;
    std::string epoch_;
    std::shared_ptr<link_events> owner_;
    std::string output_;
    std::uint64_t sent_ = 0;
    std::uint64_t received_ = 0;
    bool paused_ = false;
};

} // namespace cles::simulation
