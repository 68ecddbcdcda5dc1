// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "perf/fan_out/fan_out.hpp"
#include "perf/support/child_process.hpp"
#include "perf/support/latency_recorder.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>

/// Other middleware beside CLES and the hand-written exchange: each in a program of its own, all under one driver.
namespace cles::perf::peers {

using announce = child_process::announce;

/// What is asked of a node.
enum class call : std::uint8_t {
    exchange, ///< the localization packet
    task,     ///< a task without arguments, work or result
};

/// A peer does not do this, or not by this carrier. That is no failure, and is reported as what it is.
class not_offered : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// The side that asks.
class caller {
  public:
    caller() = default;
    caller(const caller&) = delete;
    caller& operator=(const caller&) = delete;
    virtual ~caller() = default;
    /// Keeps so many calls in flight until the recorder is full. A call lasts until its result, as a C++ value that was
    /// checked, is in the hands of the caller's code.
    virtual void ask(std::size_t in_flight, latency_recorder& record) = 0;
};

/// The side of the subscribers, all in one process.
class fan_out {
  public:
    fan_out() = default;
    fan_out(const fan_out&) = delete;
    fan_out& operator=(const fan_out&) = delete;
    virtual ~fan_out() = default;
    /// Has the order published, and takes what comes. Latencies are recorded where there is a recorder.
    virtual fan_out_tally run(const fan_out_order& order, latency_recorder* record) = 0;
};

/// A middleware by one of its carriers. `serve` and `publish` run in the server's process, until it is ended; the other
/// two in the client's.
///
/// \throws not_offered from each of them; the server's is told by `announce` failing
class peer {
  public:
    peer() = default;
    peer(const peer&) = delete;
    peer& operator=(const peer&) = delete;
    virtual ~peer() = default;

    virtual void serve(call what, const announce& tell) = 0;
    virtual std::unique_ptr<caller> call_at(call what, const std::string& where) = 0;
    virtual void publish(const announce& tell) = 0;
    virtual std::unique_ptr<fan_out> subscribe(const std::string& where, std::size_t subscribers) = 0;
    /// The process between the two, where there is one.
    [[nodiscard]] virtual pid_t broker() const { return -1; }
};

/// What a peer's file says of itself, and how it is made. A program links one such file.
struct description {
    const char* name;
    const char* carriers; ///< the first is the one that is meant where none is named; with spaces between
    const char* settings; ///< what makes it fast
    /// Its threads keep each other from working where all of one end share a core: both ends run on all cores.
    bool on_all_cores = false;
};
extern const description about;
std::string version();
/// \param carrier one of those
std::unique_ptr<peer> make_peer(std::string_view carrier);

/// For callers that block: one call after the other, until the recorder is full.
template <class Call>
void one_by_one(latency_recorder& record, Call&& once) {
    while (!record.full()) {
        const auto began = std::chrono::steady_clock::now();
        once();
        record.record(std::chrono::steady_clock::now() - began);
    }
}

} // namespace cles::perf::peers
