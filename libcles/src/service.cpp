// SPDX-License-Identifier: BSL-1.0
#include <cles/service.hpp>

#include "protocol/grammar.hpp"
#include "protocol/message.hpp"
#include "shell/command.hpp"
#include "shell/engine.hpp"
#include "shell/feed_handle.hpp"
#include "shell/group_feed_handle.hpp"
#include "shell/option_checks.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/strand.hpp>
#include <boost/asio/thread_pool.hpp>

#include <algorithm>
#include <utility>

namespace cles {
namespace asio = boost::asio;

namespace {

// A pool has several threads, so that the service takes a strand of it.
asio::any_io_executor one_at_a_time(asio::any_io_executor executor) {
    if (executor.target<asio::thread_pool::executor_type>() != nullptr) {
        return asio::make_strand(executor);
    }
    return executor;
}

} // namespace

service::service(asio::any_io_executor executor, service_options options) {
    const auto listen_at = std::move(options.listen);
    engine_ = std::make_shared<detail::engine>(one_at_a_time(std::move(executor)), std::move(options));
    try {
        engine_->start(listen_at);
    } catch (...) {
        engine_->stop();
        throw;
    }
}

service::~service() { engine_->stop(); }

const std::string& service::name() const noexcept { return engine_->node().name; }

std::vector<std::string> service::endpoints() const { return engine_->node().endpoints; }

const asio::any_io_executor& service::get_executor() const noexcept { return engine_->executor(); }

std::string service::listen(std::string_view url) { return engine_->listen(url); }

void service::set_peer(std::string_view name, std::string_view url) { engine_->routes().set_peer(name, url); }

void service::leave() {
    engine_->neighbours().leave();
    engine_->settle();
}

void service::set_gossip(const gossip_options& how) { engine_->neighbours().gossip(how); }

std::vector<peer> service::peers() const { return engine_->node().others.list(engine_->now()); }

void service::stop() { engine_->stop(); }

void service::add(registration task) { engine_->add(std::move(task)); }

publisher service::make_publisher() { return publisher{engine_->outside_updates()}; }

void service::publish(std::string_view noun, const std::function<void(json_writer&)>& write) {
    engine_->publish(noun, write);
}

bool service::retire(std::string_view noun) { return engine_->node().published.retire(noun); }

void service::publish_when_room(std::string_view noun, std::string_view json, detail::pending_ptr operation) {
    engine_->publish_when_room(noun, json, std::move(operation));
}

std::uint64_t service::send(const detail::outgoing& request, const call_options& options,
                            detail::pending_ptr operation) {
    return engine_->send(request, options, std::move(operation));
}

std::uint64_t service::send_command(std::string_view command, const call_options& options,
                                    detail::pending_ptr operation) {
    return shell::send_command(*engine_, command, options, std::move(operation));
}

void service::cancel(detail::engine& inside, std::uint64_t ticket) { inside.cancel(ticket); }

std::shared_ptr<detail::feed_control> service::make_feed(std::string_view noun, const bind_options& options) {
    protocol::noun_view parts;
    std::string why;
    if (!protocol::parse_noun(noun, parts, why)) {
        return shell::make_refused_feed(engine_, errc::bad_request, why);
    }
    if (auto wrong = shell::objection_to(options); !wrong.empty()) {
        return shell::make_refused_feed(engine_, errc::invalid_option, std::move(wrong));
    }
    if (engine_->stopped()) {
        return shell::make_refused_feed(engine_, errc::stopped, "the service has been stopped");
    }
    std::string scratch;
    const std::string path{protocol::canonical_path(parts, scratch)};
    const bool routes = engine_->node().way != nullptr; // then `all` is bound by links, through this service itself
    if (options.multicast_ || (parts.target == "all" && options.at_.empty() && !routes)) {
        return shell::make_group_feed(engine_, parts, path, options);
    }
    auto made =
        std::make_shared<shell::feed_handle>(engine_, std::string{parts.target}, path, options.every_.count() > 0);
    engine_->feeds().enter(made->machine(), made,
                           {.noun = std::string{noun},
                            .at = options.at_,
                            .deadline = options.deadline_,
                            .every_ms = static_cast<std::uint32_t>(std::clamp<std::int64_t>(
                                options.every_.count(), 0, static_cast<std::int64_t>(protocol::max_deadline_ms))),
                            .keep = options.keep_});
    return made;
}

std::string service::request(std::string_view command, const call_options& options) {
    const auto* own = engine_->executor().target<asio::io_context::executor_type>();
    if (own == nullptr) {
        throw error(errc::would_deadlock, "the blocking form needs a service on an io_context, which it runs");
    }
    auto* io = &static_cast<asio::io_context&>(own->context());
    if (own->running_in_this_thread()) {
        throw error(errc::would_deadlock, "inside a handler, co_await async_request instead");
    }
    struct outcome {
        bool ended = false;
        boost::system::error_code code;
        std::string body;
        std::string why;
    };
    const auto result = std::make_shared<outcome>();
    auto asked = options;
    asked.diagnostics(result->why);
    asio::post(engine_->executor(), [this, result, asked, text = std::string{command}] {
        async_request(text, asked, [result](boost::system::error_code code, const json_text& reply) {
            result->code = code;
            result->body = reply.text;
            result->ended = true;
        });
    });
    io->restart();
    while (!result->ended) {
        if (io->run_one() == 0) {
            throw error(errc::stopped, "the context was stopped before the answer came");
        }
    }
    if (result->code) {
        throw error(result->code, result->why);
    }
    return std::move(result->body);
}

} // namespace cles
