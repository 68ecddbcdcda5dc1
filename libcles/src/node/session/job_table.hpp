// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/jobs.hpp>
#include <cles/json_writer.hpp>
#include <cles/verb.hpp>

#include "protocol/request_line.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>

namespace cles::core {

class call;
class reply_writer;
struct node_state;

/// The jobs of a node, which are the requests that its handlers have received and not finished, and how long the
/// handlers of each task take (docs/protocol.md, "Jobs"). An interface, so that a program that does not list its jobs
/// does not link it.
class job_table {
  public:
    job_table() = default;
    job_table(const job_table&) = delete;
    job_table& operator=(const job_table&) = delete;
    virtual ~job_table() = default;

    /// A handler that replies later is about to be called. Returns the number of its job, from 1.
    [[nodiscard]] virtual std::uint64_t add(call& job, std::string_view task, std::string_view requester) = 0;
    /// Has `status` called when that job is listed.
    virtual void set_status(std::uint64_t number, std::function<job_status()> status) = 0;
    /// The job has been answered here, after that time.
    virtual void note_answer(std::uint64_t number, std::chrono::nanoseconds took) noexcept = 0;
    /// Its handler has released it.
    virtual void remove(std::uint64_t number) noexcept = 0;

    /// A handler that replies at once has taken that time.
    virtual void record(verb how, std::string_view task, std::chrono::nanoseconds took) noexcept = 0;
    /// Writes the value of `tasks_us` in the metrics.
    virtual void write_times(json_writer& w) const = 0;

    /// Writes the reply to `PULL self:cles/jobs`, of at most so many bytes.
    virtual void write(json_writer& w, const node_state& host, std::size_t longest) const = 0;
    /// Serves a request of the reserved task; false if it is for something else.
    virtual bool serve(node_state& host, reply_writer& replies, const protocol::request_line& request,
                       const identity& peer) = 0;
};

} // namespace cles::core

namespace cles::detail {

/// Creates the table of a node.
struct jobs_part {
    std::unique_ptr<core::job_table> (*make)();
};

} // namespace cles::detail
