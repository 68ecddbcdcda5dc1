// SPDX-License-Identifier: BSL-1.0
#include "system.hpp"

#include <cles/setting_error.hpp>

#include "cpu_use.hpp"
#include "disk.hpp"
#include "kernel_file.hpp"
#include "load.hpp"
#include "memory.hpp"
#include "network.hpp"
#include "processes.hpp"
#include "sampler.hpp"
#include "system_time.hpp"
#include "utc.hpp"

#include <chrono>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

namespace sysinfo {
namespace {

constexpr std::uint32_t default_interval_ms = 1000;
constexpr std::uint32_t shortest_interval_ms = 10;
constexpr std::uint32_t longest_interval_ms = 86'400'000;
constexpr std::uint32_t default_listed = 10;
constexpr std::uint32_t most_listed = 1000;

// How busy the cores are between two readings: one memory for all who ask.
class load_meter {
  public:
    load read() {
        auto out = parse_load(read_kernel_file("/proc/loadavg", "load"));
        const auto times = parse_cpu_times(read_kernel_file("/proc/stat", "load"));
        out.cores = std::thread::hardware_concurrency();
        const std::scoped_lock lock{mutex_};
        out.busy = use_.take(times, cles::time_point::clock::now());
        return out;
    }

  private:
    std::mutex mutex_;
    cpu_use use_;
};

void require_within(std::uint32_t value, std::uint32_t least, std::uint32_t most, const char* what) {
    if (value < least || value > most) {
        throw cles::setting_error(what, std::string{what} + ": " + std::to_string(value) + " is not between " +
                                            std::to_string(least) + " and " + std::to_string(most));
    }
}

// PULL reads now; BIND has the sampler publish.
template <class F>
void offer(cles::registrar& to, const std::shared_ptr<sampler>& samples, const std::string& noun, F read,
           cles::task_info info) {
    samples->offer(noun, [noun, read, updates = to.make_publisher()] { updates.update(noun, read()); });
    info.idempotent = true;
    to.on_pull(noun, read, info);
    info.inline_ok = true;
    to.on_bind(
        noun,
        [samples, noun](const cles::request& asked) {
            if (!asked.parameters().empty()) {
                throw cles::error(cles::errc::bad_request, "'" + noun + "' is published without parameters");
            }
            samples->want(noun);
        },
        info);
}

} // namespace

void settings::check() const {
    require_within(interval_ms.value_or(default_interval_ms), shortest_interval_ms, longest_interval_ms, "interval_ms");
    require_within(processes.value_or(default_listed), 0, most_listed, "processes");
}

void register_tasks(cles::registrar& to, const settings& wanted) {
    wanted.check();
    const auto interval = wanted.interval_ms.value_or(default_interval_ms);
    const std::size_t listed = wanted.processes.value_or(default_listed);

    const auto samples = std::make_shared<sampler>(std::chrono::milliseconds{interval});
    const auto meter = std::make_shared<load_meter>();
    register_system_time(to);
    offer(to, samples, "utc", read_utc, {.description = "Time of day: seconds since 1970, and as text"});
    offer(to, samples, "load", [meter] { return meter->read(); },
          {.description = "How busy the cores are: part of their time (0 to 1), and runnable threads"});
    offer(to, samples, "memory", [] { return parse_memory(read_kernel_file("/proc/meminfo", "memory")); },
          {.description = "Memory in bytes"});
    offer(to, samples, "disk", read_disk, {.description = "File systems and disks, in bytes"});
    offer(to, samples, "network", [] { return parse_network(read_kernel_file("/proc/net/dev", "network")); },
          {.description = "Interfaces: bytes, packets, errors and drops since they came up"});
    offer(to, samples, "processes", [listed] { return read_processes(listed); },
          {.description = "How many processes and threads, and those with the most memory (bytes)"});
}

} // namespace sysinfo
