// SPDX-License-Identifier: BSL-1.0
#include "api/engine.hpp"

#include "api/service_call.hpp"

#include <exception>
#include <string>
#include <string_view>
#include <utility>

namespace cles::detail {
namespace {

core::local_node_options options_of(service_options&& all) {
    return {.node = {.name = std::move(all.name),
                     .pool = std::move(all.pool),
                     .bounds = all.limits,
                     .authorise = std::move(all.authorise),
                     .log = std::move(all.log),
                     .metrics = std::move(all.metrics),
                     .load = std::move(all.load)},
            .peers = std::move(all.peers),
            .insecure = all.insecure,
            .networks = std::move(all.networks),
            .multicast = std::move(all.multicast),
            .gossip = std::move(all.gossip),
            .on_name_taken = std::move(all.on_name_taken),
            .routing = all.routing};
}

} // namespace

engine::engine(const boost::asio::any_io_executor& executor, service_options options)
    : engine(std::make_shared<asio_port::asio_environment>(executor), std::move(options)) {}

engine::engine(std::shared_ptr<asio_port::asio_environment> by, service_options options)
    : local_node(by, options_of(std::move(options))), asio_(*by) {}

std::weak_ptr<engine> engine::weak() { return std::static_pointer_cast<engine>(shared_from_this()); }

void engine::add(registration offered) {
    core::handler entry{.info = std::move(offered.info)};
    if (offered.plain) {
        entry.plain = [this, handler = std::move(offered.plain)](const request& r, json_writer& w) {
            const core::flush_scheduler::serving during{flush_scheduler()};
            handler(r, w);
        };
    }
    if (offered.async) {
        entry.start = [this, handler = std::move(offered.async),
                       self = weak()](const request& r, const std::shared_ptr<core::call>& call) {
            // Held here too, so that the reply is the handler's exception, and not that its responder was destroyed
            // without one.
            const auto control = std::make_shared<api::service_call>(call, executor(), self);
            const core::flush_scheduler::serving during{flush_scheduler()};
            try {
                handler(r, responder{control});
            } catch (...) {
                fail_with(*control, std::current_exception());
            }
        };
    }
    node().tasks.add(offered.verb, offered.task, std::move(entry));
}

std::shared_ptr<update_sink> engine::cross_thread_updates() {
    if (!cross_thread_updates_) {
        // The service outlives the updates that are taken: it closes this when it stops.
        cross_thread_updates_ = std::make_shared<asio_port::cross_thread_updates>(
            executor(),
            [weak = weak()](std::string_view noun, std::string_view json) {
                const auto self = weak.lock();
                if (!self) { // an earlier failure was logged, and the program then released the service
                    return;
                }
                try {
                    self->publish(noun, [json](json_writer& w) { write_text(w, json); });
                } catch (const error& e) {
                    self->write_log(log_level::warning,
                                    "an update of '" + std::string{noun} + "' was refused: " + e.message());
                }
            },
            [weak = weak()](std::size_t count) {
                if (const auto self = weak.lock()) {
                    self->write_log(log_level::warning,
                                    std::to_string(count) +
                                        " updates were dropped: they come faster than they can be sent");
                }
            });
        if (stopped()) {
            cross_thread_updates_->close();
        }
    }
    return cross_thread_updates_;
}

void engine::stop() {
    if (cross_thread_updates_) {
        cross_thread_updates_->close();
    }
    local_node::stop();
}

} // namespace cles::detail
