// SPDX-License-Identifier: BSL-1.0
#include <cles/service.hpp>

#include "api/engine.hpp"

#include <boost/asio/dispatch.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/strand.hpp>
#include <boost/asio/thread_pool.hpp>

#include <future>
#include <type_traits>
#include <utility>

namespace cles {
namespace asio = boost::asio;

namespace {

// A pool has several threads, so the service uses a strand of it.
asio::any_io_executor one_at_a_time(asio::any_io_executor executor) {
    if (executor.target<asio::thread_pool::executor_type>() != nullptr) {
        return asio::make_strand(executor);
    }
    return executor;
}

using strand = asio::strand<asio::any_io_executor>;

// Runs `f` on the strand that was made of a pool, and waits for it; inline if there is none.
template <class F>
std::invoke_result_t<F> run_on(const strand* own, F f) {
    if (own == nullptr || own->running_in_this_thread()) {
        return f();
    }
    const auto pool = own->get_inner_executor();
    if (const auto* threads = pool.target<asio::thread_pool::executor_type>();
        threads != nullptr && threads->running_in_this_thread()) {
        throw error(errc::would_deadlock, "on a thread of the service's pool: call it on the service's own executor");
    }
    std::packaged_task<std::invoke_result_t<F>()> task{std::move(f)};
    auto result = task.get_future();
    asio::post(*own, std::move(task));
    return result.get();
}

// The same on a strand that is not used yet: inline if called on a thread of the pool.
template <class F>
void begin_on(const strand* own, F f) {
    if (own == nullptr) {
        f();
        return;
    }
    std::packaged_task<void()> task{std::move(f)};
    auto begun = task.get_future();
    asio::dispatch(*own, std::move(task));
    begun.get();
}

const strand* strand_of(bool pooled, const asio::any_io_executor& executor) noexcept {
    return pooled ? executor.target<strand>() : nullptr;
}

} // namespace

namespace detail {

void withdrawal::operator()() const {
    if (const auto alive = service.lock()) {
        alive->cancel(ticket);
    }
}

void remote_withdrawal::operator()() const {
    asio::dispatch(executor, [weak = service, begun = ticket] {
        if (const auto alive = weak.lock(); alive && *begun != 0) {
            alive->cancel(*begun);
        }
    });
}

void bind_withdrawal::operator()() const {
    const auto withdraw = [made = feed] {
        if (const auto alive = made->lock()) {
            alive->cancel_start();
        }
    };
    if (executor) {
        asio::dispatch(executor, withdraw);
    } else {
        withdraw();
    }
}

} // namespace detail

service::service(asio::any_io_executor executor, service_options options)
    : pooled_(executor.target<asio::thread_pool::executor_type>() != nullptr) {
    const auto listen_at = std::move(options.listen);
    engine_ = std::make_shared<detail::engine>(one_at_a_time(std::move(executor)), std::move(options));
    try {
        begin_on(strand_of(pooled_, get_executor()), [&] { engine_->start(listen_at); });
    } catch (...) {
        engine_->stop();
        throw;
    }
}

service::~service() { engine_->stop(); }

const std::string& service::name() const noexcept { return engine_->node().name; }

bool service::on_strand() const noexcept {
    const auto* own = strand_of(pooled_, get_executor());
    return own == nullptr || own->running_in_this_thread();
}

std::vector<std::string> service::endpoints() const {
    return run_on(strand_of(pooled_, get_executor()), [this] { return engine_->node().endpoints; });
}

const asio::any_io_executor& service::get_executor() const noexcept { return engine_->executor(); }

// User functions that these call (log, load) may destroy the service.

std::string service::listen(std::string_view url) {
    return run_on(strand_of(pooled_, get_executor()), [inside = engine_, url] { return inside->listen(url); });
}

void service::set_peer(std::string_view name, std::string_view url) {
    run_on(strand_of(pooled_, get_executor()),
           [inside = engine_, name, url] { inside->peer_channels().set_peer(name, url); });
}

void service::leave() {
    run_on(strand_of(pooled_, get_executor()), [inside = engine_] { inside->discovery().leave(); });
}

void service::set_gossip(const gossip_options& how) {
    run_on(strand_of(pooled_, get_executor()), [inside = engine_, &how] { inside->discovery().gossip(how); });
}

std::vector<peer> service::peers() const {
    return run_on(strand_of(pooled_, get_executor()), [this] { return engine_->node().peers.list(engine_->now()); });
}

void service::stop() { engine_->stop(); }

void service::add(registration task) {
    run_on(strand_of(pooled_, get_executor()), [this, &task] { engine_->add(std::move(task)); });
}

publisher service::make_publisher() {
    return run_on(strand_of(pooled_, get_executor()), [this] { return publisher{engine_->cross_thread_updates()}; });
}

void service::fail_later(detail::pending_ptr operation, const detail::outgoing_body& why) {
    engine_->fail_later(std::move(operation), why.wrong, why.text);
}

void service::publish(std::string_view noun, const std::function<void(json_writer&)>& write) {
    run_on(strand_of(pooled_, get_executor()), [&, inside = engine_] { inside->publish(noun, write); });
}

bool service::retire(std::string_view noun) {
    return run_on(strand_of(pooled_, get_executor()), [this, noun] { return engine_->node().published.retire(noun); });
}

std::uint64_t service::publish_or_wait(detail::engine& inside, std::string_view noun, std::string_view json,
                                       detail::pending_ptr operation) {
    return inside.publish_or_wait(noun, json, std::move(operation));
}

std::uint64_t service::close(detail::engine& inside, std::chrono::milliseconds limit, detail::pending_ptr operation) {
    return inside.close(limit, std::move(operation));
}

std::uint64_t service::send(detail::engine& inside, const detail::outgoing& request, const call_options& options,
                            detail::pending_ptr operation) {
    return inside.send(request.verb, request.noun, request.body, options, std::move(operation));
}

std::uint64_t service::send_command(detail::engine& inside, std::string_view command, const call_options& options,
                                    detail::pending_ptr operation) {
    return inside.send_command(command, options, std::move(operation));
}

void service::send_elsewhere(const detail::remote_withdrawal& withdraw, const detail::outgoing& request,
                             const call_options& options, detail::pending_ptr operation) {
    asio::dispatch(get_executor(),
                   [inside = engine_, ticket = withdraw.ticket, verb = request.verb, noun = std::string{request.noun},
                    body = std::string{request.body}, options, operation = std::move(operation)]() mutable {
                       *ticket = inside->send(verb, noun, body, options, std::move(operation));
                   });
}

void service::send_command_elsewhere(const detail::remote_withdrawal& withdraw, const std::string& command,
                                     const call_options& options, detail::pending_ptr operation) {
    asio::dispatch(get_executor(), [inside = engine_, ticket = withdraw.ticket, command, options,
                                    operation = std::move(operation)]() mutable {
        *ticket = inside->send_command(command, options, std::move(operation));
    });
}

void service::publish_elsewhere(const detail::remote_withdrawal& withdraw, const std::string& noun,
                                const std::string& json, detail::pending_ptr operation) {
    asio::dispatch(get_executor(), [inside = engine_, ticket = withdraw.ticket, noun, json,
                                    operation = std::move(operation)]() mutable {
        *ticket = inside->publish_or_wait(noun, json, std::move(operation));
    });
}

void service::close_elsewhere(const detail::remote_withdrawal& withdraw, std::chrono::milliseconds limit,
                              detail::pending_ptr operation) {
    asio::dispatch(get_executor(),
                   [inside = engine_, ticket = withdraw.ticket, limit, operation = std::move(operation)]() mutable {
                       *ticket = inside->close(limit, std::move(operation));
                   });
}

void service::start_bind(const detail::bind_withdrawal& withdraw, detail::binding_ptr operation,
                         const std::string& noun, const bind_options& options) {
    constexpr auto start = [](const std::shared_ptr<detail::engine>& inside, std::weak_ptr<detail::feed_control>& made,
                              detail::binding_ptr bound, const std::string& target, const bind_options& chosen) {
        const auto control = detail::make_feed(inside, target, chosen);
        made = control;
        bound->make_of(control);
        control->start(detail::pending_ptr{bound.release()});
    };
    if (!withdraw.executor) {
        start(engine_, *withdraw.feed, std::move(operation), noun, options);
        return;
    }
    asio::dispatch(withdraw.executor, [start, inside = engine_, made = withdraw.feed, noun, options,
                                       operation = std::move(operation)]() mutable {
        start(inside, *made, std::move(operation), noun, options);
    });
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
            throw error(errc::stopped, "the context was stopped before the answer was received");
        }
    }
    if (result->code) {
        throw error(result->code, result->why);
    }
    return std::move(result->body);
}

} // namespace cles
