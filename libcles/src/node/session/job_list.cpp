// SPDX-License-Identifier: BSL-1.0
#include <cles/jobs.hpp>

#include "json/json_members.hpp"
#include "node/base/metrics.hpp"
#include "node/session/call.hpp"
#include "node/session/job_table.hpp"
#include "node/session/reply_writer.hpp"
#include "node/session/request_checks.hpp"
#include "protocol/grammar.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace cles {
namespace core {
namespace {

constexpr std::size_t most_tasks = 256; // whose times are kept; what is registered later has none
constexpr std::size_t spare = 256;      // for the head of a reply, and what closes it

struct listed_job {
    call* job = nullptr;
    std::string task{};
    std::string requester{};
    std::function<job_status()> status{};
};

// Told to stop, it is listed until its handler has released it; answered, it is not listed any more.
bool is_listed(const call& job) { return !job.ended() || job.stopped(); }

std::string_view state_of(const call& job, const job_status& status) {
    return job.stopped() ? "stopping" : job.wanted().routed ? "moved" : status.waiting ? "queued" : "running";
}

std::int64_t milliseconds_between(time_point from, time_point to) {
    return std::max<std::int64_t>(std::chrono::duration_cast<std::chrono::milliseconds>(to - from).count(), 0);
}

void write_job(json_writer& w, std::uint64_t number, const listed_job& what, time_point now) {
    const auto& job = *what.job;
    const auto status = what.status ? what.status() : job_status{};
    w.begin_object();
    write_member(w, "job", number);
    write_member(w, "verb", to_string(job.wanted().verb));
    write_member(w, "task", what.task);
    write_member(w, "requester", what.requester);
    write_member(w, "state", state_of(job, status));
    write_member(w, "age_ms", milliseconds_between(job.started(), now));
    if (!job.ended()) {
        write_member(w, "deadline_ms", milliseconds_between(now, job.due()));
    }
    if (const auto progress = status.progress.value_or(job.reported()); progress > 0) {
        write_member(w, "progress", progress);
    }
    w.end_object();
}

class job_list final : public job_table {
  public:
    std::uint64_t add(call& job, std::string_view task, std::string_view requester) override {
        const auto number = last_ + 1;
        jobs_.emplace(number, listed_job{.job = &job, .task = std::string{task}, .requester = std::string{requester}});
        last_ = number;
        return number;
    }

    void set_status(std::uint64_t number, std::function<job_status()> status) override {
        if (const auto found = jobs_.find(number); found != jobs_.end()) {
            found->second.status = std::move(status);
        }
    }

    void note_answer(std::uint64_t number, std::chrono::nanoseconds took) noexcept override {
        if (const auto found = jobs_.find(number); found != jobs_.end()) {
            record(found->second.job->wanted().verb, found->second.task, took);
        }
    }

    void remove(std::uint64_t number) noexcept override { jobs_.erase(number); }

    void record(verb how, std::string_view task, std::chrono::nanoseconds took) noexcept override {
        try {
            auto found = times_.find(task);
            if (found == times_.end()) {
                if (times_.size() >= most_tasks) {
                    return;
                }
                found = times_.try_emplace(std::string{task}).first;
            }
            auto& times = found->second[static_cast<std::size_t>(how)];
            if (!times) {
                times = std::make_unique<latency_histogram>();
            }
            times->record(took);
        } catch (...) { // no memory: this one is not measured
            return;
        }
    }

    void write_times(json_writer& w) const override {
        w.begin_object();
        for (const auto& [task, verbs] : times_) {
            w.plain_key(std::string_view{task});
            w.begin_object();
            for (std::size_t i = 0; i < verb_count; ++i) {
                if (verbs[i]) {
                    w.plain_key(verb_names[i]);
                    write_quantiles(w, *verbs[i]);
                }
            }
            w.end_object();
        }
        w.end_object();
    }

    void write(json_writer& w, const node_state& host, std::size_t longest) const override {
        std::vector<std::uint64_t> numbers; // the oldest first
        for (const auto& [number, each] : jobs_) {
            if (is_listed(*each.job)) {
                numbers.push_back(number);
            }
        }
        std::sort(numbers.begin(), numbers.end());
        const auto now = host.time.now();
        std::size_t bytes = spare;
        bool is_cut = false;
        w.begin_object();
        w.plain_key("jobs");
        w.begin_array();
        for (const auto number : numbers) {
            std::string text;
            json_writer part{text};
            write_job(part, number, jobs_.find(number)->second, now);
            bytes += text.size() + 1;
            if (bytes > longest) {
                is_cut = true;
                break;
            }
            w.raw(text);
        }
        w.end_array();
        if (is_cut) {
            write_member(w, "more", true);
        }
        w.end_object();
    }

    bool serve(node_state& host, reply_writer& replies, const protocol::request_line& r,
               const identity& peer) override {
        const auto& parameters = r.noun.parameters;
        if (parameters.empty() || parameters[0] != "jobs") {
            return false;
        }
        if (r.verb == verb::pull && parameters.size() == 1) {
            replies.write(r, [&](json_writer& w) { write(w, host, replies.longest()); });
            return true;
        }
        if (r.verb == verb::push && parameters.size() == 3 && parameters[2] == "cancel") {
            cancel(host, replies, r, peer);
            return true;
        }
        return false;
    }

  private:
    static void write_quantiles(json_writer& w, const latency_histogram& times) {
        const auto us = [&times](double q) { return static_cast<double>(times.quantile(q).count()) / 1000.0; };
        w.begin_object();
        write_member(w, "samples", times.count());
        write_member(w, "p50", us(0.5));
        write_member(w, "p99", us(0.99));
        w.end_object();
    }

    // Null if it has ended.
    [[nodiscard]] std::shared_ptr<call> find_open(std::uint64_t number) const {
        const auto found = jobs_.find(number);
        return found == jobs_.end() || found->second.job->ended() ? nullptr : found->second.job->shared_from_this();
    }

    void cancel(node_state& host, reply_writer& replies, const protocol::request_line& r, const identity& peer) {
        if (!host.security && !peer.local) { // anybody there could end the work of others
            const auto why = host.name + ": without security, jobs are cancelled from the host of the node only";
            log_denial(host, peer, r, why);
            replies.fail(r, errc::denied, why);
            return;
        }
        const auto number = protocol::number_between(r.noun.parameters[1], 1, protocol::max_id);
        if (!number) {
            replies.fail(r, errc::bad_request, host.name + ": the number of a job is 1 to 2^63-1");
            return;
        }
        const auto job = find_open(*number);
        if (!job) {
            const auto known = jobs_.find(*number);
            const bool is_stopping = known != jobs_.end();
            replies.fail(r, errc::no_task,
                         is_stopping ? host.name + ": job " + std::to_string(*number) + " has been told to stop already"
                                     : host.name + " has no job " + std::to_string(*number));
            return;
        }
        const reply_target where{r};
        const std::string by{requester_of(host, peer, r)};
        job->abort({.code = errc::cancelled,
                    .message = host.name + ": the job was cancelled " + (by.empty() ? "on this host" : "by " + by)});
        replies.done(where, {});
    }

    using verb_times = std::array<std::unique_ptr<latency_histogram>, verb_count>;

    boost::unordered_flat_map<std::uint64_t, listed_job> jobs_; // by number
    std::map<std::string, verb_times, std::less<>> times_;      // by task
    std::uint64_t last_ = 0;
};

std::unique_ptr<job_table> make_list() { return std::make_unique<job_list>(); }

} // namespace
} // namespace core

const detail::jobs_part* jobs() noexcept {
    static constexpr detail::jobs_part part{&core::make_list};
    return &part;
}

} // namespace cles
