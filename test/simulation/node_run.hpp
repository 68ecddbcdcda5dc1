// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include "core/absence.hpp"
#include "core/node.hpp"
#include "core/turns.hpp"
#include "simulation/connection.hpp"
#include "simulation/feed_ties.hpp"
#include "simulation/group_seat.hpp"
#include "simulation/group_watch.hpp"
#include "simulation/network.hpp"
#include "simulation/place.hpp"
#include "simulation/route.hpp"

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::simulation {

class datagram_port;

/// One run of a node, from its start to its end or crash: the machines of core, its links and routes, and what drives
/// them. Does what shell/engine.hpp does, in virtual time.
class node_run final : public place, private core::turn_host {
  public:
    node_run(network& net, unsigned host, unsigned run, core::node_setup setup);
    ~node_run() override;

    /// Listens. To be called once, when it is owned.
    void start(bool strangers);
    /// Takes part in the multicast group. To be called once, when it is owned.
    void join_group(group_watch& judge);
    /// Ends it as a crash does: nothing here hears of it, and the system closes what was open.
    void crash();

    [[nodiscard]] const std::shared_ptr<core::node>& node() noexcept { return node_; }
    [[nodiscard]] const limits& bounds() const noexcept { return node_->bounds; }
    [[nodiscard]] network& net() noexcept { return net_; }
    [[nodiscard]] witness& watcher() noexcept { return net_.watcher(); }
    [[nodiscard]] planted fault() const noexcept { return net_.fault(); }
    [[nodiscard]] feed_ties& feeds() noexcept { return feeds_; }
    /// Null where it takes no part in multicast.
    [[nodiscard]] group_seat* seat() noexcept { return seat_.get(); }
    /// Which run of its host it is, from 1.
    [[nodiscard]] unsigned run_number() const noexcept { return run_; }
    [[nodiscard]] std::uint64_t draw_id() noexcept { return node_->next_id++; }

    std::uint64_t ask(unsigned to, carrier by, route::request r, detail::pending_ptr operation,
                      core::outbound::progress_function progress);
    void cancel(std::uint64_t id);
    route& route_to(unsigned to, carrier by);
    void forget_waiting(const core::feed_machine& feed);

    std::shared_ptr<connection> adopt(link_ptr made, connection::origin from);
    void forget(connection& c);
    [[nodiscard]] core::turns& turns() noexcept { return turns_; }

    /// Looks whether its memory is within its limits.
    void check_bounds();
    /// Looks whether nothing is kept, when all has been quiet for long.
    void check_rest();

  private:
    void after() override { follow_deadlines(); }
    void post_turn() override;
    [[nodiscard]] bool stopped() const override { return false; }
    [[nodiscard]] core::publications& published() override { return node_->published; }
    void route_on(time_point) override {}
    void settle() override {} // `after` does
    void after_jump() override;
    void follow_deadlines();
    void on_accepted(link_ptr made);
    [[nodiscard]] bool has_room(bool for_source);
    void complain(rule which, const std::string& what) { watcher().broken(which, name() + ": " + what); }

    network& net_;
    unsigned run_;
    std::shared_ptr<core::node> node_;
    std::vector<std::shared_ptr<connection>> open_;
    std::map<std::pair<unsigned, carrier>, std::unique_ptr<route>> routes_;
    feed_ties feeds_{*this};
    std::shared_ptr<datagram_port> door_;
    std::unique_ptr<group_seat> seat_;
    std::optional<time_point> set_for_;
    core::absence absence_;
    std::uint64_t timer_ = 0; // the one that counts
    core::turns turns_{*this, *this};
};

} // namespace cles::simulation
