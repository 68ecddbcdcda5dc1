// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/chrono.hpp>
#include <cles/plugin_call.hpp>
#include <cles/plugin_text.hpp>
#include <cles/registrar.hpp>

#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

/// The plugin's side of its tasks. Not for applications.

namespace cles::detail {

/// A task of this plugin. It exists until the process ends, because the host may call it until then. Its handler is
/// destroyed when the plugin has stopped and no job uses it any more.
class plugin_task {
  public:
    plugin_task(const cles_host& host, registration task)
        : host_(host), handler_(std::make_shared<registration>(std::move(task))) {}

    static void start(void* user, cles_job job, const cles_request* request) {
        static_cast<plugin_task*>(user)->run(job, detail::known_part(request));
    }
    void stop() noexcept {
        std::shared_ptr<registration> last; // destroyed without the lock: the handler may wait for threads
        const std::scoped_lock lock{mutex_};
        last.swap(handler_);
    }

  private:
    std::shared_ptr<registration> handler() {
        const std::scoped_lock lock{mutex_};
        return handler_;
    }

    void run(cles_job job, const cles_request& asked) noexcept {
        try {
            const auto keep = handler();
            if (!keep) {
                throw error(errc::unavailable, "the plugin has stopped");
            }
            serve(*keep, job, asked);
        } catch (...) {
            plugin_call control{host_, job};
            try {
                fail_with(control, std::current_exception());
            } catch (...) { // no memory to report why: destroying `control` fails the job
            }
        }
    }

    void serve(const registration& task, cles_job job, const cles_request& asked) {
        std::vector<std::string_view> parameters(asked.parameter_count);
        for (std::size_t i = 0; i < parameters.size(); ++i) {
            parameters[i] = view_of(asked.parameters[i]);
        }
        identity peer{.transport = std::string{view_of(asked.peer_transport)},
                      .address = std::string{view_of(asked.peer_address)},
                      .name = std::string{view_of(asked.peer_name)},
                      .uid = std::nullopt,
                      .local = asked.peer_local != 0};
        if (asked.peer_uid >= 0) {
            peer.uid = static_cast<std::uint32_t>(asked.peer_uid);
        }
        const request_data data{.verb = static_cast<cles::verb>(asked.verb),
                                .node = view_of(asked.node),
                                .task = view_of(asked.task),
                                .parameters = parameters,
                                .body = asked.body.size == 0 ? std::string_view{"{}"} : view_of(asked.body),
                                .peer = &peer,
                                .deadline = asked.left_ns == 0
                                                ? time_point{}
                                                : time_point::clock::now() + std::chrono::nanoseconds{asked.left_ns},
                                .trace = view_of(asked.trace),
                                .requester = view_of(asked.requester),
                                .forwarded_by = view_of(asked.forwarded_by)};
        const request what{data};
        if (task.plain) {
            std::string result;
            json_writer writer{result};
            run_plain(task.plain, what, writer);
            host_.done(&host_, job, abi_text(result));
        } else {
            const auto control = std::make_shared<plugin_call>(host_, job);
            try {
                task.async(what, responder{control});
            } catch (...) {
                fail_with(*control, std::current_exception());
            }
        }
    }

    const cles_host& host_;
    std::mutex mutex_;
    std::shared_ptr<registration> handler_;
};

class plugin_updates final : public update_sink {
  public:
    explicit plugin_updates(const cles_host& host) noexcept : host_(host) {}
    void publish(std::string_view noun, std::string_view json) override {
        host_.publish(&host_, abi_text(noun), abi_text(json));
    }

  private:
    const cles_host& host_;
};

/// The registrar of a plugin: adds each task to the host.
class plugin_registrar final : public registrar {
  public:
    using task_list = std::vector<std::unique_ptr<plugin_task>>;

    plugin_registrar(const cles_host& host, task_list& tasks) noexcept : host_(host), tasks_(tasks) {}

    void add(registration task) override {
        const auto what = std::string{to_string(task.verb)} + " '" + task.task + "'";
        if (task.coroutine) {
            throw error(errc::failed, what + " is a coroutine, for which a plugin has no executor: "
                                             "let the handler take a responder, and `delegate` with it");
        }
        if (task.info.must_be_signed && host_.abi_minor < 2) {
            throw error(errc::failed, what + " must be signed, which this host does not support");
        }
        std::vector<cles_text> parameters;
        for (const auto& name : task.info.parameters) {
            parameters.push_back(abi_text(name));
        }
        const bool handled = task.plain || task.async;
        const auto info = task.info;
        const auto name = task.task;
        const auto verb = task.verb;
        tasks_.push_back(std::make_unique<plugin_task>(host_, std::move(task)));
        const cles_task crossing{
            .size = sizeof(cles_task),
            .verb = static_cast<std::uint32_t>(verb),
            .name = abi_text(name),
            .description = abi_text(info.description),
            .parameters = parameters.data(),
            .parameter_count = parameters.size(),
            .flags = (info.idempotent ? CLES_TASK_IDEMPOTENT : 0U) | (info.inline_ok ? CLES_TASK_INLINE_OK : 0U) |
                     (info.must_be_signed ? CLES_TASK_SIGNED : 0U) | (info.local ? CLES_TASK_LOCAL : 0U),
            .reserved = 0,
            .start = handled ? &plugin_task::start : nullptr,
            .user = tasks_.back().get(),
            .types = abi_text(info.types)};
        switch (host_.add_task(&host_, &crossing)) {
        case CLES_ADDED: return;
        case CLES_TASK_EXISTS: throw error(errc::already_registered, what);
        case CLES_BAD_TASK: throw error(errc::invalid_name, what + " is refused by the host");
        default: throw error(errc::failed, what + " is too late: tasks can only be added while the plugin starts");
        }
    }

    [[nodiscard]] publisher make_publisher() override { return publisher{std::make_shared<plugin_updates>(host_)}; }

  private:
    const cles_host& host_;
    task_list& tasks_;
};

} // namespace cles::detail
