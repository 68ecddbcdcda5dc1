// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "node/membership/membership.hpp"
#include "port/group_port.hpp"
#include "simulation/network/place.hpp"
#include "simulation/world/plan.hpp"
#include "simulation/world/witness.hpp"

#include <memory>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace cles::simulation {

class node_run;
class simulated_security;
class world;

/// A part of the workload: performs one kind of activity and checks its rules. To add an activity, add an action
/// (plan.hpp), its generation (make_plan.cpp), and a part that performs and checks it (world.cpp lists them).
class part {
  public:
    explicit part(world& in) noexcept : world_(in) {}
    part(const part&) = delete;
    part& operator=(const part&) = delete;
    virtual ~part() = default;

    /// Performs the action, if it is one of this part's.
    virtual void perform(const action& what) = 0;
    /// The faults are about to end.
    virtual void on_mending() {}
    /// A node has started: registers what it offers.
    virtual void on_start(node_run&) {}
    /// A node is about to leave with notice.
    virtual void on_leaving(node_run&) {}
    /// A node is about to crash, and loses its state.
    virtual void on_crash(node_run&) {}
    /// A node is about to receive a datagram of the multicast group, or to send one.
    virtual void on_group_heard(node_run&, const core::group_source&, std::string_view) {}
    virtual void on_group_sent(node_run&, std::string_view) {}
    /// With security: a node is about to serve a request.
    virtual void on_request(node_run&, const access&) {}
    /// With security: a line leaves for a peer (of streams, updates only), or has arrived from one by datagram.
    virtual void on_link_sends(node_run&, const identity&, std::string_view) {}
    virtual void on_link_receives(node_run&, const identity&, std::string_view) {}
    /// With security: the group port delivers or sends a line for which each copy counts.
    virtual void on_group_accepted(node_run&, std::string_view /*member*/, std::string_view) {}
    /// A node reports that the state of another one has changed.
    virtual void on_neighbour(node_run&, std::string_view, core::membership::change) {}
    /// The faults have just ended.
    virtual void on_calm() {}
    /// The faults ended a while ago: tries what has to work again; the result is checked later.
    virtual void probe() {}
    virtual void judge_probe() {}
    /// All is well: restarts a node, and checks soon how long that takes.
    virtual void reboot() {}
    /// Ends all activity that continues by itself.
    virtual void wind_down() {}
    /// There has been no activity for long.
    virtual void judge_rest() {}

  protected:
    void complain(rule which, const std::string& what);
    void complain(rule which, const place& at, const std::string& what) { complain(which, at.name() + " " + what); }

    world& world_;
};

/// The parts of a run. What is reported to them goes to each, in this order.
class part_list {
  public:
    void add(std::unique_ptr<part> next) { all_.push_back(std::move(next)); }
    template <class... Arguments>
    void each(void (part::*what)(Arguments...), std::type_identity_t<Arguments>... arguments) const {
        for (const auto& p : all_) {
            ((*p).*what)(arguments...);
        }
    }

  private:
    std::vector<std::unique_ptr<part>> all_;
};

/// Requests and their handlers: every node sends every other node requests with all verbs but BIND, cancels some, and
/// replies at once, later, or never. Each request has a unique number, which its reply contains.
std::unique_ptr<part> make_asking(world& in);

/// Publishing and subscribing: every node publishes some nouns, and binds those of others, by links and in the
/// multicast group, there by name or for all publishers. The bindings and updates of each publisher in the group are
/// recorded.
std::unique_ptr<part> make_following(world& in);

/// Clients such as netcat on streams whose requests have no id, and which therefore rely on the order of replies. They
/// send faster than replies arrive, make mistakes, read slowly, and end their links in every possible way.
std::unique_ptr<part> make_talking(world& in);

/// Security: the roster changes, and nodes do not receive it at the same time; somebody forges and repeats datagrams,
/// and opens links. Checks what may never happen then.
class securing : public part {
  public:
    using part::part;
    /// What a new node of that host uses; null if it cannot start, because its roster does not contain it.
    virtual std::shared_ptr<simulated_security> equip(unsigned host) = 0;
};
std::unique_ptr<securing> make_securing(world& in);

/// Membership: nodes announce themselves to the group, leave it with or without notice, restart, and some use another
/// node's name. What each node has received is recorded, to check its conclusions.
std::unique_ptr<part> make_neighbouring(world& in);

} // namespace cles::simulation
