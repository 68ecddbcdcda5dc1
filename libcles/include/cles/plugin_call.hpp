// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/chrono.hpp>
#include <cles/error.hpp>
#include <cles/job_feed.hpp>
#include <cles/plugin_text.hpp>
#include <cles/responder.hpp>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

/// The plugin's side of a job. Not for applications.

namespace cles::detail {

/// A feed of a job inside a plugin: its handle.
class plugin_feed final : public job_feed_control {
  public:
    plugin_feed(const cles_host& host, cles_job job, cles_feed feed) noexcept : host_(host), job_(job), feed_(feed) {}

    void next(event_callback taken) override;
    void close() noexcept override { host_.unbind(&host_, feed_); }

  private:
    struct awaited; // a call of `next`

    const cles_host& host_;
    cles_job job_;
    cles_feed feed_;
};

/// The implementation of a responder inside a plugin: the job's handle. Destroying it fails the job if nothing has been
/// replied. May be used on any thread, because the host's functions may.
class plugin_call final : public call_control {
  public:
    plugin_call(const cles_host& host, cles_job job) noexcept : host_(host), job_(job) {}
    plugin_call(const plugin_call&) = delete;
    plugin_call& operator=(const plugin_call&) = delete;
    ~plugin_call() override {
        if (!answered_) {
            plugin_call::fail(errc::failed, "the handler ended without an answer");
        }
    }

    void done(std::string_view json) override {
        answered_ = true;
        host_.done(&host_, job_, abi_text(json));
    }
    void fail(errc code, std::string_view message) override {
        answered_ = true;
        host_.fail(&host_, job_, abi_text(wire_name(code)), abi_text(message));
    }
    void refuse(std::string_view message, std::chrono::milliseconds retry) override {
        answered_ = true;
        constexpr std::chrono::milliseconds::rep most = 86'400'000;
        const auto ms = std::clamp<std::chrono::milliseconds::rep>(retry.count(), 0, most);
        host_.busy(&host_, job_, abi_text(message), static_cast<std::uint32_t>(ms));
    }
    bool progress(double fraction, std::string_view json) override {
        return host_.progress(&host_, job_, fraction, abi_text(json)) != 0;
    }
    [[nodiscard]] bool stopped() const noexcept override { return host_.stopped(&host_, job_) != 0; }
    void log(log_level level, std::string_view text) override {
        host_.job_log(&host_, job_, static_cast<std::uint32_t>(level), abi_text(text));
    }

    void on_stop(std::function<void()> callback) override {
        auto owned = std::make_unique<std::function<void()>>(std::move(callback));
        const cles_callback crossing{.call =
                                         [](void* user) {
                                             try {
                                                 (*static_cast<std::function<void()>*>(user))();
                                             } catch (...) { // exceptions must not cross the ABI; the job continues
                                             }
                                         },
                                     .drop = [](void* user) { delete static_cast<std::function<void()>*>(user); },
                                     .user = owned.get()};
        host_.on_stop(&host_, job_, &crossing);
        static_cast<void>(owned.release());
    }

    void delegate(std::string_view command, const call_options& options, answer_callback answered) override {
        if (!options.at_node_.empty()) { // the interface has no place for it
            throw error(errc::invalid_option, "a plugin cannot state which node may answer at a URL");
        }
        if (options.is_on_behalf_) { // it would be sent with the rights of the node
            throw error(errc::invalid_option, "a plugin cannot send requests on behalf of a member");
        }
        auto owned = std::make_unique<asked>(asked{host_, job_, std::move(answered), options.on_progress_});
        const cles_ask crossing{.size = sizeof(cles_ask),
                                .urgent = options.urgent_ ? 1U : 0U,
                                .deadline_ms = options.deadline_.count(),
                                .at = abi_text(options.at_),
                                .answered = &asked::answer,
                                .progress = options.on_progress_ ? &asked::report : nullptr,
                                .user = owned.get(),
                                .hops = abi_hops(options.hops_),
                                .reserved = 0};
        static_cast<void>(owned.release()); // freed by `answer`, which may run before `delegate` returns
        host_.delegate(&host_, job_, abi_text(command), &crossing);
    }

    std::shared_ptr<job_feed_control> bind(job_feed_maker /*make*/, std::string_view noun,
                                           const bind_options& options) override {
        constexpr std::uint32_t first_minor = 7;
        if (host_.abi_minor < first_minor) {
            throw error(errc::failed, "this host has no feeds for jobs, which came with version 1.7 of the plugin ABI");
        }
        if (options.multicast_ || !options.at_node_.empty()) { // the interface has no place for it
            throw error(errc::invalid_option, "a plugin cannot bind by multicast, or state which node may answer");
        }
        if (options.is_on_behalf_) { // it would be bound with the rights of the node
            throw error(errc::invalid_option, "a plugin cannot bind on behalf of a member");
        }
        const cles_bind crossing{.size = sizeof(cles_bind),
                                 .keep = options.keep_,
                                 .every_ms = options.every_.count(),
                                 .deadline_ms = options.deadline_.count(),
                                 .at = abi_text(options.at_),
                                 .hops = abi_hops(options.hops_),
                                 .mark = options.mark_ ? 1U : 0U};
        return std::make_shared<plugin_feed>(host_, job_, host_.bind(&host_, job_, abi_text(noun), &crossing));
    }

    [[nodiscard]] bool is_thread_safe() const noexcept override { return true; }

  private:
    // A pending request of this job.
    struct asked {
        static void answer(void* user, cles_text code, cles_text json, cles_text message) {
            const std::unique_ptr<asked> self{static_cast<asked*>(user)};
            try {
                const auto failed = code.size == 0 ? boost::system::error_code{} : errc_from_wire(view_of(code));
                self->answered(failed, view_of(json), view_of(message));
            } catch (...) {
                plugin_call job{self->host, self->job};
                fail_with(job, std::current_exception());
            }
        }
        static void report(void* user, double fraction, cles_text json) {
            try {
                static_cast<asked*>(user)->progress(fraction, view_of(json));
            } catch (...) { // losing a report does no harm
            }
        }

        const cles_host& host;
        cles_job job;
        answer_callback answered;
        std::function<void(double, std::string_view)> progress;
    };

    const cles_host& host_;
    cles_job job_;
    std::atomic<bool> answered_{false};
};

struct plugin_feed::awaited {
    static void take(void* user, cles_text code, cles_text message, const cles_event* event) {
        const std::unique_ptr<awaited> self{static_cast<awaited*>(user)};
        try {
            if (code.size != 0) {
                self->taken(errc_from_wire(view_of(code)), {.text = view_of(message)});
                return;
            }
            const auto what = detail::known_part(event);
            self->taken({}, {.kind = static_cast<feed_event>(what.kind),
                             .json = view_of(what.json),
                             .publisher = view_of(what.publisher),
                             .seq = what.seq,
                             .epoch = what.epoch,
                             .missed = what.missed,
                             .text = view_of(what.text),
                             .waited = std::chrono::nanoseconds{what.waited_ns}});
        } catch (...) {
            plugin_call job{self->host, self->job};
            fail_with(job, std::current_exception());
        }
    }

    const cles_host& host;
    cles_job job;
    event_callback taken;
};

inline void plugin_feed::next(event_callback taken) {
    auto owned = std::make_unique<awaited>(awaited{host_, job_, std::move(taken)});
    const cles_next crossing{.size = sizeof(cles_next), .reserved = 0, .event = &awaited::take, .user = owned.get()};
    static_cast<void>(owned.release()); // freed by `take`, which may run before `next` returns
    host_.next(&host_, feed_, &crossing);
}

} // namespace cles::detail
