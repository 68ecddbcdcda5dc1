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

/// CLES, other middleware, and the hand-written exchange: each in a program of its own, with a common driver.
namespace cles::perf::peers {

using announce = child_process::announce;

/// What a client requests.
enum class call : std::uint8_t {
    exchange, ///< the localization packet
    task,     ///< a task without arguments, work or result
};

/// A peer does not offer this, or not by this carrier. It is reported, and is not a failure.
class not_offered : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// The client.
class caller {
  public:
    caller() = default;
    caller(const caller&) = delete;
    caller& operator=(const caller&) = delete;
    virtual ~caller() = default;
    /// Keeps this number of calls in flight until the recorder is full. A call lasts until its result, as a C++ value,
    /// has been checked in the caller's code.
    virtual void ask(std::size_t in_flight, latency_recorder& record) = 0;
};

/// The subscribers, all in one process.
class fan_out {
  public:
    fan_out() = default;
    fan_out(const fan_out&) = delete;
    fan_out& operator=(const fan_out&) = delete;
    virtual ~fan_out() = default;
    /// Orders a publication, and receives the updates. Latencies are recorded if there is a recorder.
    virtual fan_out_tally run(const fan_out_order& order, latency_recorder* record) = 0;
};

/// A middleware by one of its carriers. `serve` and `publish` run in the server's process, until it is ended; the other
/// two in the client's.
///
/// \throws not_offered from each of them; the client learns of the server's by its announcement
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
    /// The process between the two, if there is one.
    [[nodiscard]] virtual pid_t broker() const { return -1; }
};

/// Describes a peer, and creates it. A program links one file that defines this.
struct description {
    const char* name;
    const char* carriers; ///< separated by spaces; the first is the default
    const char* settings; ///< what makes it fast
    /// Its threads block each other if they share a core, so both ends run on all cores.
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
