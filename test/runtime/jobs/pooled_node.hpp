// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "jobs/job_pool.hpp"
#include "jobs/pooled_registrar.hpp"
#include "support/gate.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/scripted_peer.hpp"

#include <boost/asio/io_context.hpp>

#include <algorithm>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::test {

/// Notes of several threads.
class notes {
  public:
    void add(std::string what) {
        const std::lock_guard lock{mutex_};
        all_.push_back(std::move(what));
    }
    [[nodiscard]] std::vector<std::string> all() const {
        const std::lock_guard lock{mutex_};
        return all_;
    }
    [[nodiscard]] std::size_t size() const { return all().size(); }
    [[nodiscard]] std::string joined() const {
        std::string text;
        for (const auto& each : all()) {
            text += text.empty() ? each : " " + each;
        }
        return text;
    }
    [[nodiscard]] bool has(std::string_view piece) const {
        const auto found = all();
        return std::any_of(found.begin(), found.end(),
                           [piece](const std::string& each) { return each.find(piece) != std::string::npos; });
    }

  private:
    mutable std::mutex mutex_;
    std::vector<std::string> all_;
};

/// A service whose tasks run on a pool, and peers with plain sockets.
struct pooled_node {
    explicit pooled_node(runtime::pool_options options = {.workers = 2}) {
        options.log = [this](log_level, std::string_view text) { log.add(std::string{text}); };
        pool = std::make_unique<runtime::job_pool>(car, std::move(options));
        tasks = std::make_unique<runtime::pooled_registrar>(car, *pool);
    }
    pooled_node(const pooled_node&) = delete;
    pooled_node& operator=(const pooled_node&) = delete;
    ~pooled_node() { hold.open(); }

    scripted_peer peer() { return {io, car.endpoints().front()}; }
    template <class Condition>
    void wait_for(Condition&& holds, const std::source_location& where = std::source_location::current()) {
        run_until(io, holds, patience, where);
    }
    /// Adds a task whose jobs answer through a responder.
    void add(std::string_view task, std::function<void(const responder&)> work) {
        tasks->on_delegate(task, [work = std::move(work)](const request&, const responder& job) { work(job); });
    }
    /// Adds a task that waits at the gate.
    void add_held(std::string_view task = "held") {
        tasks->on_delegate(task, [gate = held_] {
            gate->pass();
            return 1;
        });
    }

    // Its service writes to the same log.
    static service_options options_with(notes& log) {
        auto options = listening("car1");
        options.log = [&log](log_level, std::string_view text) { log.add(std::string{text}); };
        return options;
    }

    notes log;                                              // before its writers
    std::shared_ptr<gate> held_ = std::make_shared<gate>(); // of jobs that outlive this
    gate& hold = *held_;
    boost::asio::io_context io;
    service car{io, options_with(log)};
    std::unique_ptr<runtime::job_pool> pool;
    std::unique_ptr<runtime::pooled_registrar> tasks;
};

} // namespace cles::test
