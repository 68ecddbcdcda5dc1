// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/peer.hpp>

#include "node/membership/direct_links.hpp"
#include "node/membership/membership.hpp"
#include "node/membership/peer_table.hpp"
#include "node/membership/route_table.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// By which neighbour each node is reached (docs/protocol.md, "Routes"): from the links that this node has, and from
/// what its neighbours advertise.
///
/// What the rest of the node calls is virtual, so that a program that does not take part in gossip does not link it.
class reachability {
  public:
    class listener {
      public:
        listener() = default;
        listener(const listener&) = delete;
        listener& operator=(const listener&) = delete;
        /// Whether this node forwards requests of that neighbour.
        [[nodiscard]] virtual bool forwards_for(std::string_view /*neighbour*/) const { return false; }
        /// Whether that neighbour may forward requests of `requester`; empty: of this node. Without security, all may.
        [[nodiscard]] virtual bool may_forward(std::string_view /*neighbour*/, std::string_view /*requester*/) const {
            return true;
        }
        /// Whether the node may have routes. Without security, all may.
        [[nodiscard]] virtual bool is_member(std::string_view /*node*/) const { return true; }
        /// Requests for `node` no longer reach it through the neighbour at that address.
        virtual void on_route_lost(std::string_view /*node*/, std::string_view /*address*/) {}
        /// Requests for the node may be sent elsewhere from now on.
        virtual void on_route_changed(std::string_view /*node*/) {}

      protected:
        ~listener() = default;
    };

    static constexpr unsigned everywhere = route_table::max_hops; ///< how far the need for routes spreads
    static constexpr int intervals_of_need = 4;                   ///< until others' need is forgotten
    static constexpr int turns_per_interval = 8;                  ///< in which neighbours are asked
    static constexpr int pushes_per_interval = 32;                ///< of changed routes, at most

    reachability(std::string own_name, listener& out, membership& others, std::size_t max_nodes)
        : own_name_(std::move(own_name)), out_(out), others_(others), direct_(own_name_), routes_(max_nodes) {}
    virtual ~reachability() = default;

    // For the rest of the node.

    /// The only nodes to which this one may have links; empty: all.
    virtual void allow_only(std::vector<std::string> nodes);
    [[nodiscard]] const std::vector<std::string>& allowed() const noexcept { return direct_.allowed(); }
    /// The node to which requests for `node` are sent: itself, or a neighbour that is not in `via`, and may forward for
    /// `requester` (empty: for this node); empty: there is no route.
    [[nodiscard]] virtual std::string next_hop_to(std::string_view node, std::string_view via,
                                                  std::string_view requester = {}) const;
    /// Whether the node is known, and requests reach it through others only, or not at all.
    [[nodiscard]] virtual bool is_beyond(std::string_view node) const;
    /// The number of links to the node; nothing: there is no route.
    [[nodiscard]] virtual std::optional<unsigned> hops_to(std::string_view node) const;
    /// Completes the list of nodes by the routes to them.
    virtual void add_routes(std::vector<peer>& all) const;
    /// No link could be opened to the node, or it does not reply: what it has advertised does not count until it does.
    virtual void lose(std::string_view neighbour, time_point now);
    /// A link has been opened to it.
    virtual void on_opened(std::string_view node);
    /// The node has announced other `links`.
    virtual void on_links_announced(std::string_view node);
    /// The name has another incarnation, or none.
    virtual void on_new_incarnation(std::string_view node);
    /// Which neighbours may forward has changed.
    virtual void on_rights_changed();

    // For gossip.

    /// Whether both nodes' `links` allow it.
    [[nodiscard]] bool allows(std::string_view node) const { return direct_.allows(node, others_); }
    /// Whether the node may be asked for its table.
    [[nodiscard]] bool may_ask(std::string_view node, time_point now) const;
    /// Whether requests for others can be sent through it: no attempt has failed.
    [[nodiscard]] bool is_usable(std::string_view neighbour) const;
    /// After this time without a reply, a link is taken for lost.
    [[nodiscard]] std::chrono::milliseconds silence() const noexcept { return interval() / 4; }
    /// How far this node's need for routes, and that of those who ask it, spreads; 0: routes are not needed.
    [[nodiscard]] unsigned need(time_point now) const noexcept;
    /// Determines this node's own need, and which links are lost. To be called in each turn.
    void review(time_point now);
    /// A node asks for routes.
    void on_question(const protocol::routes_question& asked, time_point now);
    /// What is advertised to the neighbour `to`, if anything.
    [[nodiscard]] std::optional<route_advert> advert_of(const delta_entry& item, std::string_view to) {
        return advert_of(item, to, usable());
    }
    /// The same for many entries.
    [[nodiscard]] route_function adverts_to(std::string_view to);
    /// The node has replied.
    void on_reached(std::string_view node);
    /// The neighbour has replied.
    void on_reply(const peer_table& table);
    /// It has sent routes without being asked, or asks for numbers.
    void on_pushed(const peer_table& table);
    /// Whether there are routes to be pushed to neighbours.
    [[nodiscard]] bool has_unsent() const noexcept { return !unsent_.empty(); }
    /// When they may be: at once, but not too often, because nodes that lose their routes may change each other's
    /// several times.
    [[nodiscard]] time_point next_push() const noexcept { return next_push_; }
    /// The nodes to which routes have changed since the last call, each with a request for a greater number of it, if
    /// needed; none if it is too early.
    using news = std::map<std::string, std::optional<route_advert>, std::less<>>;
    [[nodiscard]] news take_unsent(time_point now);

  private:
    [[nodiscard]] std::chrono::milliseconds interval() const noexcept { return interval_among(others_.size()); }
    [[nodiscard]] unsigned own_need(time_point now) const;
    /// Whether requests for the node are sent straight to it. If it does not reply, it may have crashed.
    [[nodiscard]] bool is_direct(std::string_view node) const { return is_direct(direct_.state_of(node, others_)); }
    [[nodiscard]] static bool is_direct(direct_links::state now) noexcept;
    void leave(std::string_view neighbour);
    void apply(const peer_table& table);
    void apply(const std::string& name, std::uint32_t epoch, std::string_view neighbour, route_advert advert,
               const route_table::usable_function& works);
    [[nodiscard]] std::optional<route_advert> advert_of(const delta_entry& item, std::string_view to,
                                                        const route_table::usable_function& works);
    void answer(const peer_table::route& wanted, std::string_view neighbour);
    void request(const std::string& node, std::uint64_t number, unsigned distance);
    void request_if_needed(const std::string& node);
    void report_lost_links();
    void reconsider(std::string_view neighbour);
    [[nodiscard]] std::string_view address_of(std::string_view node) const {
        return others_.address_of(node).value_or(std::string_view{});
    }
    /// The same, asked once for each neighbour: it must not change meanwhile.
    [[nodiscard]] route_table::usable_function usable_now() const;
    [[nodiscard]] route_table::usable_function usable() const {
        return [this](std::string_view by) { return is_usable(by) && out_.may_forward(by, {}); };
    }

    const std::string own_name_;
    listener& out_;
    membership& others_;
    direct_links direct_;
    route_table routes_;
    unsigned own_need_ = 0;
    unsigned others_need_ = 0; // as far as it is to spread from here
    time_point others_need_until_{};
    std::uint64_t number_ = 1; // of this node's interval, for routes to it
    time_point interval_began_{};
    news unsent_;
    time_point next_push_{};
};

} // namespace cles::core
