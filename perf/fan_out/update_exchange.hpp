// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/run.hpp>
#include <cles/service.hpp>

#include "perf/support/child_process.hpp"
#include "perf/support/handler_style.hpp"

#include <boost/asio/io_context.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

/// BIND and UPDATE of the localization packet, published as fast as all binders accept it.
namespace cles::perf {

/// What to publish: sent as a PUSH, which is answered at once.
struct publish_order {
    std::uint64_t updates = 0;
};
BOOST_DESCRIBE_STRUCT(publish_order, (), (updates))

/// A node that publishes when it receives a `publish_order`. Does not return.
void serve_updates(std::string_view url, const run_options& how, const child_process::announce& announce);

/// As what a binder receives a value.
enum class value_form : std::uint8_t {
    raw,   ///< `json_text`: checked, but not read
    typed, ///< the described struct
};

struct update_tally {
    std::uint64_t delivered = 0; ///< to the code of all binders together
    std::uint64_t missed = 0;    ///< reported as gaps, or out of order
    std::chrono::nanoseconds took{};
};

struct update_load {
    std::size_t binders = 1;
    std::uint64_t updates = 0;
    value_form form = value_form::raw;
    handler_style style = handler_style::coroutine;
    run_options how{};
    std::uint32_t keep = 0; ///< updates that the publisher queues for a slow binder; 0: the protocol's default
};

/// Binds all, each at a client of its own, because feeds of one client would share a link; has the updates published,
/// and receives them until every binder has the last one. \pre there are as many clients as binders \throws
/// cles::error, std::runtime_error if a value was changed
update_tally take_updates(boost::asio::io_context& io, const std::vector<std::unique_ptr<cles::service>>& clients,
                          const update_load& load);

} // namespace cles::perf
