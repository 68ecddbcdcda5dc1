// SPDX-License-Identifier: BSL-1.0
#include "simulation/world/node_run.hpp"

#include "simulation/network/group_port.hpp"
#include "simulation/workload/part.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <memory>
#include <utility>

namespace cles::simulation {
namespace {

const part_list nobody;

std::string_view name_of(core::membership::change what) noexcept {
    constexpr std::array<std::string_view, 9> names{"finds",        "finds elsewhere", "hears nothing of",
                                                    "hears again",  "sees leaving",    "gives up",
                                                    "hears two of", "gives way to",    "sees other links of"};
    return names[static_cast<std::size_t>(what)];
}

class ended_operation final : public detail::pending {
  public:
    ended_operation(std::function<void(std::string_view)> succeeded, std::function<void(errc, std::string_view)> failed)
        : succeeded_(std::move(succeeded)), failed_(std::move(failed)) {}
    verdict offer(std::string_view json) override {
        if (!detail::is_valid_answer(json)) {
            return verdict::malformed;
        }
        const std::unique_ptr<ended_operation> self{this};
        succeeded_(json);
        return verdict::completed;
    }
    void fail(boost::system::error_code code, std::string_view why) override {
        const std::unique_ptr<ended_operation> self{this};
        if (failed_) {
            failed_(static_cast<errc>(code.value()), why);
        }
    }
    void discard() noexcept override { delete this; }

  private:
    std::function<void(std::string_view)> succeeded_;
    std::function<void(errc, std::string_view)> failed_;
};

} // namespace

detail::pending_ptr when_ended(std::function<void(std::string_view json)> succeeded,
                               std::function<void(errc code, std::string_view why)> failed) {
    return detail::pending_ptr{new ended_operation{std::move(succeeded), std::move(failed)}};
}

node_run::node_run(network& net, unsigned host, unsigned run, std::string name, options how)
    : place(net.time(), host, std::move(name)), net_(net), run_(run),
      judges_(how.judges != nullptr ? *how.judges : nobody), security_(std::move(how.security)),
      environment_(std::make_shared<virtual_environment>(net, *this, how.seed, how.strangers)),
      local_(std::make_shared<core::local_node>(
          environment_,
          core::local_node_options{
              .node = {.name = this->name(),
                       .bounds = how.bounds,
                       .authorise = security_ ? authoriser{[this](const access& what) {
                           judges_.each(&part::on_request, *this, what);
                           return true;
                       }}
                                              : authoriser{},
                       .security =
                           security_ ? std::shared_ptr<core::node_security>{security_, &security_->of_node()} : nullptr,
                       .secured = security_ ? security_->maker_of_protocol() : nullptr,
                       .load = std::move(how.load)},
              .peers = std::move(how.peers),
              .insecure = true,
              .multicast = {.interface = how.multicast ? "net0" : ""},
              .gossip = std::move(how.gossip),
              .routing = how.routing})),
      told_(local_->discovery().membership_watcher()) {
    local_->node().peers.watch(this);
}

node_run::~node_run() { crash(); }

void node_run::start() {
    started_ = now();
    run([this] { local_->start({net_.url_of(host(), carrier::stream), net_.url_of(host(), carrier::datagram)}); });
    if (fault() == planted::names_given_up) {
        constexpr std::chrono::milliseconds soon{1};
        later(soon, [this] { environment_->run_timer_as_if(now() + core::discovery_grace::length); });
    }
}

void node_run::stop() {
    watcher().saw(name(), "stops");
    run([this] { local_->stop(); });
}

// Actions of the node after its process has ended have no effect; it releases its resources.
void node_run::crash() {
    if (environment_->has_ended()) {
        return;
    }
    watcher().saw(name(), "crashes");
    environment_->end();
    local_->stop();
    environment_->discard_tasks();
}

void node_run::fall_silent() {
    group()->fall_silent();
    local_->discovery().leave();
}

// With security, datagrams are for a name, whose address is known here.
std::string node_run::address_for(unsigned to, carrier by) const {
    const bool by_name = by == carrier::name || (by == carrier::datagram && net_.secured());
    return by_name ? std::string{} : net_.url_of(to, by);
}

std::uint64_t node_run::ask(unsigned to, carrier by, const request_order& what, detail::pending_ptr operation,
                            core::outbound::progress_function progress) {
    return local_->send(what.verb, what.noun, what.body,
                        call_options{}
                            .deadline(what.deadline)
                            .at(address_for(to, by))
                            .hops(what.hops)
                            .urgent(by == carrier::urgent)
                            .on_progress(std::move(progress)),
                        std::move(operation));
}

void node_run::on_link_sends(const identity& to, std::string_view line) {
    judges_.each(&part::on_link_sends, *this, to, line);
}

void node_run::on_link_receives(const identity& from, std::string_view line) {
    judges_.each(&part::on_link_receives, *this, from, line);
}

void node_run::on_peer(std::string_view node, core::membership::change what, std::string_view where) {
    watcher().saw(name(), name_of(what), node);
    if (what != core::membership::change::clash || fault() != planted::clash_kept) {
        judges_.each(&part::on_neighbour, *this, node, what);
    }
    told_.on_peer(node, what, where);
}

// -- checks ----------------------------------------------------------------------------------------------------------

void node_run::check_bounds() {
    const auto expect_at_most = [&](std::size_t most, std::size_t count, const char* what) {
        if (count > most) {
            complain(rule::bounded, "holds " + std::to_string(count) + " " + what);
        }
    };
    const auto& b = bounds();
    auto& n = *node();
    constexpr std::size_t largest_datagram = 1500;
    expect_at_most(b.remembered + b.running * largest_datagram, n.remembered.used, "bytes of remembered datagrams");
    expect_at_most(b.running, n.counts.handlers_running, "handlers that run");
    expect_at_most(b.peers, n.peers.size(), "known nodes");
    expect_at_most(b.group_leases, n.counts.group_leases, "leases of the group");
    expect_at_most(group_port::max_waiting, group() != nullptr ? group()->unsent() : 0, "bytes for the group");
    // The limit on unread output, the replies of one turn beyond it, running handlers, and updates, which are sent in
    // pieces. The node's own requests are not limited.
    constexpr std::size_t piece = 65536;
    constexpr std::size_t lines_per_write = 32;
    const auto longest = std::min<std::size_t>(b.line, 4096);
    expect_at_most(b.unread + (lines_per_write + b.in_flight) * longest + 2 * piece, environment_->most_held(),
                   "bytes for a link");
    for (const auto& c : local_->connections().all()) {
        const auto& serving = c->session().serving();
        expect_at_most(b.bindings, serving.bindings(), "bindings");
        expect_at_most(b.in_flight + b.waiting / 2, serving.in_flight(), "requests in flight");
    }
}

void node_run::check_rest() {
    const auto expect_none = [&](std::size_t count, const char* what) {
        if (count != 0) {
            complain(rule::at_rest, std::to_string(count) + " " + what);
        }
    };
    auto& n = *node();
    // Security looks at its files, and sharing at the loads of others.
    const std::size_t regular = (security_ ? 1U : 0U) + (n.sharing != nullptr ? 1U : 0U);
    expect_none(n.deadlines.size() - std::min(n.deadlines.size(), regular), "deadlines");
    expect_none(n.counts.routed, "requests that other nodes serve");
    expect_none(n.remembered.used, "bytes remembered");
    expect_none(n.kept_requests->used(), "bytes of requests that wait for a link");
    expect_none(n.counts.handlers_running, "handlers that run");
    expect_none(n.peers.size(), "nodes that are known though all are silent");
    expect_none(n.counts.group_leases, "leases of the group");
    expect_none(group() != nullptr ? group()->unsent() : 0, "bytes that wait for the group");
    for (const auto& c : local_->connections().all()) {
        expect_none(c->is_source() ? 1 : 0, "source that is kept");
        expect_none(c->session().serving().in_flight(), "requests in flight");
        expect_none(c->session().serving().bindings(), "bindings");
        expect_none(c->session().asking().in_flight(), "requests that wait for an answer");
        expect_none(c->is_idle() ? 0 : 1, "link that is not at rest");
    }
    expect_none(n.published.take_waiters().size(), "publications that wait");
}

} // namespace cles::simulation
