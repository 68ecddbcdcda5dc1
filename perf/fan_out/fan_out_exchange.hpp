// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/run.hpp>
#include <cles/service.hpp>

#include "fan_out.hpp"
#include "perf/support/child_process.hpp"
#include "perf/support/handler_style.hpp"

#include <boost/asio/io_context.hpp>

#include <cstdint>
#include <vector>

/// One publisher and many binders by the library, at both ends.
namespace cles::perf {

/// A node that publishes when it receives a PUSH of a `fan_out_order` for its task "publish". The PUSH is answered when
/// all has been published: paced, without waiting for the binders, or as fast as they accept it. Does not return.
void serve_fan_out(service_options options, const run_options& how, const child_process::announce& announce);

/// How the binders of a pass receive updates.
struct fan_out_binding {
    handler_style style = handler_style::coroutine;
    run_options how{};
    std::uint32_t keep = 0; ///< updates that the publisher queues for a slow binder; 0: the protocol's default
    bool multicast = false; ///< bind by the multicast group of the clients
};

/// Binds the ordered number of feeds to "car1:localization", distributed over the clients, has the updates published,
/// and receives them as C++ values. A client opens a link for each of its feeds, but has one socket for the group.
/// Latencies are recorded if there is a recorder. \throws cles::error, or std::runtime_error if a value was changed
fan_out_tally take_fan_out(boost::asio::io_context& io, const std::vector<cles::service*>& clients,
                           const fan_out_order& order, const fan_out_binding& binding, latency_recorder* record);

} // namespace cles::perf
