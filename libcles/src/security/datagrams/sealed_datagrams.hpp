// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/environment.hpp"
#include "security/datagrams/datagram_sessions.hpp"
#include "security/datagrams/group_receiver.hpp"
#include "security/datagrams/group_sender.hpp"
#include "security/datagrams/newer_rosters.hpp"

#include <cstdint>
#include <functional>
#include <map>
#include <string_view>

namespace cles::security {

/// A socket through which a node sends and receives sealed datagrams. What `datagram_sink` says of its functions holds
/// for these, too.
class datagram_socket {
  public:
    datagram_socket() = default;
    datagram_socket(const datagram_socket&) = delete;
    datagram_socket& operator=(const datagram_socket&) = delete;

    virtual void send_sealed(const datagram_path& to, bytes_view datagram) = 0;
    virtual void on_opened(const datagram_source& from, std::uint32_t epoch, std::string_view line) = 0;
    virtual void on_established(const datagram_source& with, std::uint32_t epoch) = 0;
    virtual void on_gave_up(const datagram_source& with, bool lost) = 0;
    /// The announcement of a member that has a newer roster has arrived in a session.
    virtual void on_announcement(const datagram_source&, std::string_view) {}
    /// There may be a member there whose roster is so old that it can open nothing in the group.
    virtual void on_outdated(const datagram_source&) {}
    [[nodiscard]] virtual bool holds(const datagram_source&) const { return false; }

  protected:
    ~datagram_socket() = default;
};

/// All sealed datagrams of one node: its sessions, what it sends to the group and receives from it, and its sockets.
class sealed_datagrams final : private datagram_sink {
  public:
    explicit sealed_datagrams(fleet& of, entropy& random = system_entropy());

    struct observer {
        std::function<void(time_point at)> due;                                         ///< call `on_time` then
        std::function<void(std::uint32_t member, std::uint32_t roster_version)> stated; ///< in a session
        std::function<void(const datagram_source& by, hello_refusal why)> refused;
    };
    /// Called once, before all others.
    void begin(std::uint32_t epoch, const core::clock& time, observer by);
    /// Nothing is sent, received or reported any more.
    void end();

    /// A number for `datagram_path::local`. The socket must live until it is removed.
    [[nodiscard]] std::uint32_t add(datagram_socket& socket);
    void remove(std::uint32_t number);

    /// HELLO, WELCOME or DATA has arrived at a socket.
    void receive(const datagram_path& from, bytes_view datagram);
    /// See `datagram_sessions::send`.
    bool send(const datagram_source& to, std::string_view line);
    bool contact(const datagram_source& with);
    void check_peer(const datagram_source& with, time_point since);
    void release(const datagram_source& which) { sessions_.release(which); }

    /// A datagram has been dropped that was not sealed.
    void count_unsealed() noexcept { ++unsealed_; }
    [[nodiscard]] std::uint64_t unsealed() const noexcept { return unsealed_; }
    /// Sealed datagrams of the group that this node could not open: of another fleet, or of another generation of the
    /// group key.
    [[nodiscard]] std::uint64_t group_unopened() const noexcept { return group_unopened_; }

    /// See `group_receiver`. If there is somebody to contact, that is done; whose roster is old is reported to the
    /// socket at which it was heard.
    group_receiver::result open_group(const datagram_path& from, bytes_view datagram);
    [[nodiscard]] bool accept(const group_receiver::ticket& t, group_receiver::ordered_by order) {
        return receiver_.accept(t, order);
    }
    [[nodiscard]] core::datagram_admission::repetition accept_announcement(const group_receiver::ticket& t,
                                                                           std::uint64_t seq) {
        return receiver_.accept_announcement(t, seq);
    }
    /// See `group_sender::seal`.
    [[nodiscard]] bytes_view seal_for_group(std::string_view line) { return sender_.seal(line); }

    void on_time(time_point now);
    /// Whether to fetch the newer roster of a member now; see `newer_rosters`.
    [[nodiscard]] bool may_fetch_roster(std::uint32_t from) {
        return time_ != nullptr && rosters_.may_fetch(from, now());
    }
    [[nodiscard]] const fleet& members() const noexcept { return fleet_; }
    /// See `fleet::observe`.
    [[nodiscard]] std::shared_ptr<void> observe(fleet::observer changed) { return fleet_.observe(std::move(changed)); }

  private:
    // datagram_sink
    void send(const datagram_path& to, bytes_view datagram) override;
    [[nodiscard]] node_statement statement() override;
    void established(const datagram_source& with, const node_statement& stated, bool restarted) override;
    void opened(const datagram_source& from, std::uint32_t epoch, std::string_view line) override;
    void gave_up(const datagram_source& with, bool lost) override;
    void refused(const datagram_source& by, hello_refusal why) override;
    [[nodiscard]] bool holds(const datagram_source& which) const override;

    [[nodiscard]] datagram_socket* find(std::uint32_t number) const;
    [[nodiscard]] bool is_own(bytes_view datagram);
    [[nodiscard]] time_point now() const { return time_->now(); }
    void report_due();

    fleet& fleet_;
    group_sender sender_;
    group_receiver receiver_;
    datagram_sessions sessions_;
    newer_rosters rosters_;
    const core::clock* time_ = nullptr;
    std::uint32_t epoch_ = 0;
    observer observer_;
    std::map<std::uint32_t, datagram_socket*> sockets_;
    std::uint32_t last_number_ = 0;
    std::uint64_t unsealed_ = 0;
    std::uint64_t group_unopened_ = 0;
};

} // namespace cles::security
