// SPDX-License-Identifier: BSL-1.0
#include "node/node_state.hpp"

#include "node/membership/gossip.hpp"
#include "node/security_protocol.hpp"
#include "node/session/job_table.hpp"
#include "node/tracing/span_recorder.hpp"

#include <utility>

namespace cles::core {

node_state::node_state(node_options setup, const core::clock& source, const std::function<void()>& wake)
    : name(std::move(setup.name)), epoch(protocol::epoch_text(setup.epoch)), first_datagram_id(setup.first_datagram_id),
      bounds(setup.bounds), authorise(std::move(setup.authorise)), security(std::move(setup.security)),
      pools(setup.pools), log(std::move(setup.log)), metrics(std::move(setup.metrics)), load(std::move(setup.load)),
      time(source), started(source.now()), completions(std::move(setup.complete)), memory(bounds.memory),
      kept_values(std::make_shared<memory_account>(memory, memory_account::share::half)),
      kept_requests(std::make_shared<memory_account>(memory)), peers(name, setup.epoch, deadlines, bounds.peers),
      unsent(wake), published({deadlines, counts, bounds.binding_bytes, kept_values}, bounds, completions, name, epoch,
                              unsent, &tasks, security.get()),
      unsent_relayed(wake), remembered{.limit = bounds.remembered}, secured(security ? setup.secured(*this) : nullptr),
      spans(setup.tracing != nullptr ? setup.tracing->make(*this, source) : nullptr), types(setup.types),
      jobs(setup.jobs != nullptr ? setup.jobs->make() : nullptr) {
    peers.begin(setup.pool, started);
}

node_state::~node_state() = default;

// Forwarded requests are not counted: other nodes do that work.
node_load node_state::load_now() const noexcept {
    try {
        if (load) {
            return load();
        }
    } catch (...) { // as if there were no function
    }
    return {.running = static_cast<std::uint32_t>(counts.handlers_running - counts.routed)};
}

std::vector<peer> node_state::list_peers(time_point now) const {
    auto all = peers.list(now);
    if (gossip_responder != nullptr) {
        gossip_responder->reach().add_routes(all);
    }
    return all;
}

void node_state::write_log(log_level level, const log_entry& what) const noexcept {
    try {
        if (log) {
            log(level, what);
        }
    } catch (...) { // there is nowhere to report it
    }
}

void node_state::post_log(log_level level, std::string what, std::string peer) {
    if (log) {
        completions.call([log = log, level, what = std::move(what), peer = std::move(peer)] {
            try {
                log(level, {what, peer});
            } catch (...) { // there is nowhere to report it
            }
        });
    }
}

void node_state::log_caused(const caused_line& which, const std::function<std::string()>& text) {
    if (!log) {
        return;
    }
    const auto left_out = logged.take({.kind = which.kind, .source = which.source, .most = which.most}, time.now());
    if (left_out) {
        post_log(which.level, text() + left_out_text(*left_out), std::string{which.peer});
    }
}

void node_state::log_drop(std::string_view host, std::string_view what, std::string_view why, bool malformed) {
    log_caused(
        {.level = malformed ? log_level::warning : log_level::debug,
         .kind = malformed ? "malformed" : "dropped",
         .source = host,
         .peer = host},
        [&] { return std::string{"dropped "}.append(what).append(" of ").append(host).append(": ").append(why); });
}

void node_state::log_denial(std::string_view source, std::string_view peer, const std::function<std::string()>& text) {
    log_caused({.level = log_level::info, .kind = "denied", .source = source, .peer = peer, .most = 8}, text);
}

} // namespace cles::core
