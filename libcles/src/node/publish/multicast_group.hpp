// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/multicast.hpp>

#include "node/base/deadlines.hpp"
#include "node/membership/announcement.hpp"
#include "node/node_state.hpp"
#include "node/publish/group_feeds.hpp"
#include "node/publish/group_interfaces.hpp"
#include "node/publish/group_session.hpp"
#include "port/environment.hpp"
#include "port/group_port.hpp"
#include "protocol/request_line.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

class membership;

/// Decides from which sources a publisher's updates are accepted in the multicast group: from those of the incarnation
/// that owns the name (one source for each interface; its announcements list the others). A publisher that does not
/// announce itself is bound to the source from which it was first received, until that falls silent; no other source
/// can displace it by sending updates under its name. Sources of other pools are ignored.
class publisher_sources {
  public:
    static constexpr std::chrono::milliseconds silent_after{3'500};

    publisher_sources(const membership& others, std::size_t most) noexcept : others_(others), max_entries_(most) {}

    enum class verdict : std::uint8_t {
        refused,
        taken,
        one_of_several, ///< accepted; the same update may arrive from another of its sources
        another,        ///< accepted, from another source than before: the known sequence does not apply
    };
    /// Decides on an update of that node from this source; accepting it keeps the source binding alive.
    verdict look(std::string_view node, const group_source& from, time_point now);
    /// The source belongs to another pool, until then.
    void note_foreign(const group_source& from, time_point until);
    [[nodiscard]] bool is_foreign(const group_source& from, time_point now) const noexcept {
        const auto found = foreign_.find(from);
        return found != foreign_.end() && found->second > now;
    }
    [[nodiscard]] std::size_t size() const noexcept { return source_bindings_.size(); }

  private:
    struct source_binding {
        group_source to;
        time_point heard{};
    };

    const membership& others_;
    std::size_t max_entries_;
    std::map<std::string, source_binding, std::less<>> source_bindings_; // of those that do not announce themselves
    boost::unordered_flat_map<group_source, time_point> foreign_;
};

/// An announcement as it was received from the group.
struct heard_announcement {
    announcement said;
    std::uint32_t epoch = 0;
    std::uint64_t seq = 0;
    group_source from{};
    bool again = false; ///< in a secured fleet: one with this `seq`, or a later one, has counted before
};

/// Receives what the group sends about the reserved task.
class announcement_listener {
  public:
    announcement_listener() = default;
    announcement_listener(const announcement_listener&) = delete;
    announcement_listener& operator=(const announcement_listener&) = delete;
    /// `BIND all:cles`, or `BIND car1:cles` with this node's name: a node looks for others.
    virtual void on_solicitation(bool by_name, time_point now) = 0;
    /// `UPDATE car1:cles seq= epoch= {...}`, perhaps of this node itself. In a secured fleet, it is authentic.
    virtual void on_announcement(heard_announcement heard, time_point now) = 0;
    /// This node sends to the group by other interfaces, or from other addresses, than before.
    virtual void on_interfaces_changed(time_point now) { static_cast<void>(now); }

  protected:
    ~announcement_listener() = default;
};

/// Sends whole lines, none of them too large, each as one datagram, and counts them. Returns true if everything has
/// been sent or is pending. Those that the system does not send count as failed, and the reason is logged once an hour.
bool send_to(group_port& by, node_state& node, std::string_view lines);

/// A node's membership in its multicast group: a session on each interface, and what they have in common. The same
/// update may arrive on several interfaces, and is accepted once.
///
/// It follows the interfaces of the host as they come, change and go (`group_interfaces`).
class multicast_group {
  public:
    /// `owner` is kept while what arrives is processed.
    multicast_group(std::shared_ptr<node_state> host, std::uint32_t seed, std::weak_ptr<void> owner = {});

    /// Joins the group, by the interfaces that can be used. If none can, and it is not required, it is joined when one
    /// comes. The environment must outlive this. \throws cles::error: `invalid_url`, `insecure_listen`, or the system's
    /// code
    void join(environment& by, const multicast_options& where, bool insecure);
    /// Starts to receive. Call once.
    void start();
    /// Leaves the group and ends the feeds. Idempotent.
    void stop();
    /// The names of the interfaces: "lo, eth0".
    [[nodiscard]] std::string interfaces() const;

    /// Adds the port of one interface. It must live until it is removed.
    void add(group_port& port) { ports_.push_back(&port); }
    void remove(const group_port& port) noexcept { std::erase(ports_, &port); }
    [[nodiscard]] const std::vector<group_port*>& ports() const noexcept { return ports_; }
    /// Sends a line, its LF included, as one datagram on that interface. False if it was not sent: it is too large, or
    /// too much is pending. What is not sent is counted.
    bool send(group_port& by, std::string_view line);
    /// The same on each interface. False if it was sent on none.
    bool send(std::string_view line);
    /// Asks for announcements on each interface, and binds the feeds there.
    void ask_again();
    /// Whether this node sent it itself: the system loops datagrams back for others on this host, and interfaces in the
    /// same network receive each other's.
    [[nodiscard]] bool is_own(const group_source& from) const noexcept;
    /// Whether it comes from this host, as far as that can be determined.
    [[nodiscard]] bool is_of_this_host(const group_source& from) const noexcept;

    /// `membership` receives what concerns the reserved task from now on; null: nobody. It must outlive this.
    void set_listener(announcement_listener* membership) noexcept { listener_ = membership; }
    /// Ignores the source until then: it belongs to another pool.
    void ignore_until(const group_source& from, time_point until) { sources_.note_foreign(from, until); }
    [[nodiscard]] bool is_ignored(const group_source& from, time_point now) const noexcept {
        return sources_.is_foreign(from, now);
    }
    /// The feeds that are bound through the group.
    [[nodiscard]] group_feeds& feeds() noexcept { return feeds_; }

    [[nodiscard]] std::shared_ptr<void> keep_owner() const noexcept { return owner_.lock(); }
    /// A node looks for others.
    void solicited(bool by_name, time_point now);
    /// Whether somebody else has repeated it: it is of a member that sends from other sources. An announcement states
    /// the sources itself. Asked before it is accepted, so that a copy that arrives first does not keep the other out.
    [[nodiscard]] bool is_copy(const group_datagram& datagram) const;
    /// An update under a node's name. False if it is not authentic, or of the reserved task and malformed.
    bool take(const group_datagram& datagram, time_point now);

  private:
    /// An interface that it has joined.
    struct member_interface {
        member_interface(network_interface by, const std::shared_ptr<node_state>& host, multicast_group& group,
                         std::shared_ptr<group_port> port, std::uint32_t seed)
            : where(std::move(by)), session(host, group, std::move(port), seed) {}

        network_interface where;
        group_session session;
    };
    /// Armed when the interfaces are to be compared.
    struct comparison final : deadline {
        explicit comparison(multicast_group& all) noexcept : owner(all) {}
        void on_deadline(time_point now) override { owner.follow_interfaces(now); }

        multicast_group& owner;
    };

    void join(const network_interface& interface);
    void join_all();
    void join_automatic();
    void watch();
    void compare_when_due();
    [[nodiscard]] std::vector<network_interface> list_interfaces() const;
    void follow_interfaces(time_point now);
    bool join_later(const network_interface& interface, time_point now);
    void leave(const network_interface& interface);
    void ask(group_port& by);
    void note(log_level level, std::string what) const;
    void note_left_out(const std::vector<std::string>& names);
    bool take_announcement(const group_datagram& datagram, time_point now);
    [[nodiscard]] bool is_by_its_publisher(const group_datagram& datagram) const noexcept;
    [[nodiscard]] bool is_from_stated_source(const group_datagram& datagram, const announcement& said) const;

    std::shared_ptr<node_state> node_;
    std::weak_ptr<void> owner_;
    std::vector<group_port*> ports_;
    group_feeds feeds_;
    publisher_sources sources_;
    announcement_listener* listener_ = nullptr;
    environment* environment_ = nullptr; // from `join` on
    multicast_options where_;
    bool insecure_ = false;
    bool started_ = false;
    std::optional<group_interfaces> chosen_; // until `stop`
    std::list<member_interface> members_;
    std::vector<std::string> left_out_; // interfaces, as logged last
    comparison comparison_{*this};
    std::shared_ptr<void> watch_;
};

} // namespace cles::core
