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

/// A node that publishes as it is told by a PUSH of a `fan_out_order` to its task "publish", for ever. The PUSH is
/// answered when all has been published. Paced, it publishes and goes on, as one does with what is measured anew soon;
/// otherwise as fast as the binders take it.
void serve_fan_out(service_options options, const run_options& how, const child_process::announce& announce);

/// How the binders of a pass take what comes.
struct fan_out_binding {
    handler_style style = handler_style::coroutine;
    run_options how{};
    std::uint32_t keep = 0; ///< updates that the publisher queues for a slow binder; 0: the protocol's default
    bool multicast = false; ///< bind by the group that the clients take part in
};

/// Binds as many feeds as are ordered to "car1:localization", at the clients in turn, has the updates published, and
/// takes what comes as C++ values. A client opens a link for each of its feeds, but has one socket for the group.
/// Latencies are recorded where there is a recorder. \throws cles::error, or std::runtime_error where something came
/// changed
fan_out_tally take_fan_out(boost::asio::io_context& io, const std::vector<cles::service*>& clients,
                           const fan_out_order& order, const fan_out_binding& binding, latency_recorder* record);

} // namespace cles::perf
