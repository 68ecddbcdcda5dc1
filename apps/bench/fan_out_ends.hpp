// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>
#include <cles/service.hpp>

#include "fan_out_report.hpp"
#include "options.hpp"
#include "perf/baseline/binders.hpp"
#include "perf/fan_out/fan_out.hpp"
#include "perf/support/child_process.hpp"
#include "perf/support/latency_recorder.hpp"
#include "perf/support/multicast_socket.hpp"

#include <boost/asio/io_context.hpp>

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

/// A publisher in a process of its own, and its binders in this one. Create them before anything else that the child
/// processes would inherit. By multicast each exchange has a port of its own, so that they do not mix.
namespace tool {

/// The passes of one round: one that is paced, one as fast as possible.
struct fan_out_orders {
    cles::perf::fan_out_order paced{};
    cles::perf::fan_out_order flat_out{};
};

/// The packed struct.
class fan_out_by_hand {
  public:
    fan_out_by_hand(const bench_options& options, int core);

    fan_out_figures run(const fan_out_orders& orders, cles::perf::latency_recorder& record);

  private:
    std::optional<cles::perf::reserved_group> port_;
    std::optional<cles::perf::multicast_group> group_;
    cles::perf::child_process publisher_;
    cles::perf::icd::binders binders_;
};

/// CLES.
class fan_out_by_cles {
  public:
    fan_out_by_cles(const bench_options& options, int core);

    /// Prepares for this number of binders, each a client of its own. Call it after all processes have been forked.
    void connect(std::size_t binders);
    fan_out_figures run(const fan_out_orders& orders, cles::perf::latency_recorder& record);

  private:
    const bench_options& options_;
    std::optional<cles::perf::reserved_group> port_;
    cles::multicast_options multicast_;
    cles::perf::child_process publisher_;
    std::string url_;
    std::unique_ptr<boost::asio::io_context> io_;
    std::vector<std::unique_ptr<cles::service>> services_;
    std::vector<cles::service*> clients_;
};

} // namespace tool
