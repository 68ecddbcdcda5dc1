// SPDX-License-Identifier: BSL-1.0
#include <cles/service.hpp>

#include "api/engine.hpp"

#include <boost/asio/dispatch.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/strand.hpp>
#include <boost/asio/thread_pool.hpp>

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <initializer_list>
#include <optional>
#include <thread>
#include <type_traits>
#include <utility>

namespace cles {
namespace asio = boost::asio;

peer_urls::peer_urls(std::initializer_list<value_type> urls) : map(urls) {}
peer_urls::peer_urls(const map& urls) : map(urls) {}
peer_urls::peer_urls(map&& urls) noexcept : map(std::move(urls)) {}
peer_urls::peer_urls(const peer_urls& other) = default;
peer_urls::peer_urls(peer_urls&& other) noexcept = default;
peer_urls& peer_urls::operator=(const peer_urls& other) = default;
peer_urls& peer_urls::operator=(peer_urls&& other) noexcept = default;
peer_urls::~peer_urls() = default;

namespace {

// A pool has several threads, so the service uses a strand of it.
asio::any_io_executor one_at_a_time(asio::any_io_executor executor) {
    if (executor.target<asio::thread_pool::executor_type>() != nullptr) {
        return asio::make_strand(executor);
    }
    return executor;
}

using strand = asio::strand<asio::any_io_executor>;

// Runs it on the strand that was made of a pool, and waits for it.
[[gnu::cold]] void run_and_wait(const strand& own, std::function<void()> f) {
    const auto pool = own.get_inner_executor();
    if (const auto* threads = pool.target<asio::thread_pool::executor_type>();
        threads != nullptr && threads->running_in_this_thread()) {
        throw error(errc::would_deadlock, "on a thread of the service's pool: call it on the service's own executor");
    }
    std::packaged_task<void()> task{std::move(f)};
    auto done = task.get_future();
    asio::post(own, std::move(task));
    done.get();
}

// The same on a strand that is not used yet: inline if called on a thread of the pool.
[[gnu::cold]] void begin_on(const strand* own, std::function<void()> f) {
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

const call_options& no_options() noexcept {
    static const auto& none = *new call_options; // NOLINT(bugprone-unhandled-exception-at-new): ends it
    return none;
}

struct late_start {
    asio::any_io_executor executor; ///< on which the other members are used; empty: on that of the caller
    std::weak_ptr<engine> service;
    std::uint64_t ticket = 0; ///< 0 until it has started
    std::weak_ptr<feed_control> feed{};

    explicit late_start(asio::any_io_executor on, std::weak_ptr<engine> of = {})
        : executor(std::move(on)), service(std::move(of)) {}

    void cancel() const {
        if (const auto alive = service.lock(); alive && ticket != 0) {
            alive->cancel(ticket);
        }
        if (const auto bound = feed.lock()) {
            bound->cancel_start();
        }
    }
};

void withdrawal::operator()() const {
    if (!late) {
        if (const auto alive = service.lock()) {
            alive->cancel(ticket);
        }
    } else if (late->executor) {
        asio::dispatch(late->executor, [late = late] { late->cancel(); });
    } else {
        late->cancel();
    }
}

template void slot_ref::assign_slot<asio::cancellation_slot>(void* slot, withdrawal withdraw);

} // namespace detail

template <class F>
std::invoke_result_t<F> service::run_inside(F f) const {
    using result_type = std::invoke_result_t<F>;
    if (on_strand()) {
        return f();
    }
    const auto& own = *strand_of(pooled_, get_executor());
    if constexpr (std::is_void_v<result_type>) {
        run_and_wait(own, std::ref(f));
    } else {
        std::optional<result_type> result;
        run_and_wait(own, [&] { result.emplace(f()); });
        return *std::move(result);
    }
}

service::service(asio::any_io_executor executor, const service_options& options)
    : pooled_(executor.target<asio::thread_pool::executor_type>() != nullptr) {
    engine_ = std::make_shared<detail::engine>(one_at_a_time(std::move(executor)), options);
    try {
        begin_on(strand_of(pooled_, get_executor()), [&] { engine_->start(options.listen); });
    } catch (...) {
        engine_->stop();
        throw;
    }
}

service::service(asio::io_context& context, const service_options& options)
    : service(asio::any_io_executor{context.get_executor()}, options) {}

service::~service() {
    engine_->stop();
    if (engine_->belongs_to_parent()) {
        detail::engine::keep(std::move(engine_));
    }
}

const std::string& service::name() const noexcept { return engine_->node().name; }

bool service::on_strand() const noexcept {
    const auto* own = strand_of(pooled_, get_executor());
    return own == nullptr || own->running_in_this_thread();
}

std::vector<std::string> service::endpoints() const {
    return run_inside([this] { return engine_->node().endpoints; });
}

const asio::any_io_executor& service::get_executor() const noexcept { return engine_->executor(); }

// User functions that these call (log, load) may destroy the service.

std::string service::listen(std::string_view url) {
    return run_inside([inside = engine_, url] { return inside->listen(url); });
}

void service::set_peer(std::string_view name, std::string_view url) {
    run_inside([inside = engine_, name, url] { inside->peer_channels().set_peer(name, url); });
}

void service::leave() {
    run_inside([inside = engine_] { inside->discovery().leave(); });
}

void service::set_gossip(const gossip_options& how) {
    run_inside([inside = engine_, &how] { inside->discovery().gossip(how); });
}

std::vector<peer> service::peers() const {
    return run_inside([this] { return engine_->node().list_peers(engine_->now()); });
}

void service::stop() { engine_->stop(); }

void service::add(registration task) {
    run_inside([this, &task] { engine_->add(std::move(task)); });
}

bool service::remove(cles::verb verb, std::string_view task) {
    return run_inside([this, verb, task] { return engine_->remove(verb, task); });
}

publisher service::make_publisher() {
    return run_inside([this] { return publisher{engine_->cross_thread_updates()}; });
}

void service::publish(std::string_view noun, const std::function<void(json_writer&)>& write) {
    run_inside([&, inside = engine_] { inside->publish(noun, write); });
}

bool service::retire(std::string_view noun) {
    return run_inside([this, noun] { return engine_->node().published.retire(noun); });
}

std::size_t service::retire_all(std::string_view task) {
    return run_inside([this, task] { return engine_->node().published.retire_all(task); });
}

template <class Start>
void service::start_here(const detail::slot_ref& slot, const Start& start) {
    // The ticket is 0 if the operation has completed, or its completion is queued.
    if (const auto ticket = start(*engine_); ticket != 0) {
        slot.assign({.service = engine_, .ticket = ticket});
    }
}

template <class Start>
void service::start_elsewhere(const detail::slot_ref& slot, Start start) {
    // Connected first, because the operation may end before this returns.
    const auto late = std::make_shared<detail::late_start>(get_executor(), engine_);
    slot.assign({.late = late});
    asio::dispatch(get_executor(),
                   [inside = engine_, late, start = std::move(start)]() mutable { late->ticket = start(*inside); });
}

void service::start(starting what, const detail::outgoing& request, const call_options& options) {
    constexpr auto send = [](detail::engine& inside, const detail::request_kind& kind, std::string_view noun,
                             std::string_view body, const call_options& chosen, detail::pending_ptr operation) {
        return kind.is_command ? inside.send_command(noun, chosen, std::move(operation))
                               : inside.send(kind.verb, noun, body, chosen, std::move(operation));
    };
    if (request.body.wrong) {
        engine_->fail_later(std::move(what.operation), request.body.wrong, request.body.text);
    } else if (hops(what.elsewhere)) {
        start_elsewhere(what.slot,
                        [send, kind = request.kind, noun = std::string{request.noun}, body = request.body.text, options,
                         operation = std::move(what.operation)](detail::engine& inside) mutable {
                            return send(inside, kind, noun, body, options, std::move(operation));
                        });
    } else {
        start_here(what.slot, [&](detail::engine& inside) {
            return send(inside, request.kind, request.noun, request.body.text, options, std::move(what.operation));
        });
    }
}

void service::start_update(starting what, const std::string& noun, const detail::outgoing_body& json) {
    if (json.wrong) {
        engine_->fail_later(std::move(what.operation), json.wrong, json.text);
    } else if (hops(what.elsewhere)) {
        start_elsewhere(
            what.slot, [noun, text = json.text, operation = std::move(what.operation)](detail::engine& inside) mutable {
                return inside.publish_or_wait(noun, text, std::move(operation));
            });
    } else {
        start_here(what.slot, [&](detail::engine& inside) {
            return inside.publish_or_wait(noun, json.text, std::move(what.operation));
        });
    }
}

void service::start_close(starting what, const std::chrono::milliseconds& limit) {
    if (hops(what.elsewhere)) {
        start_elsewhere(what.slot, [limit, operation = std::move(what.operation)](detail::engine& inside) mutable {
            return inside.close(limit, std::move(operation));
        });
    } else {
        start_here(what.slot, [&](detail::engine& inside) { return inside.close(limit, std::move(what.operation)); });
    }
}

void service::start_bind(detail::starting<detail::binding_ptr> what, const std::string& noun,
                         const bind_options& options) {
    constexpr auto start = [](const std::shared_ptr<detail::engine>& inside, detail::late_start& late,
                              detail::binding_ptr bound, const std::string& target, const bind_options& chosen) {
        const auto control = detail::make_feed(inside, target, chosen);
        late.feed = control;
        bound->make_of(control);
        control->start(detail::pending_ptr{bound.release()});
    };
    const bool later = hops(what.elsewhere);
    const auto late = std::make_shared<detail::late_start>(later ? get_executor() : asio::any_io_executor{});
    what.slot.assign({.late = late});
    if (!later) {
        start(engine_, *late, std::move(what.operation), noun, options);
        return;
    }
    asio::dispatch(late->executor,
                   [start, inside = engine_, late, noun, options, operation = std::move(what.operation)]() mutable {
                       start(inside, *late, std::move(operation), noun, options);
                   });
}

namespace {

// Another thread that runs the context may take what this one waits for. So a blocking request waits a little for one
// that is there, the first time, and never waits in the context for long.
constexpr std::chrono::milliseconds time_to_take{5};
constexpr std::chrono::milliseconds time_to_look{50};

struct blocking_outcome {
    // Whether another thread than that of the caller has begun the request, which is then not sent.
    bool is_elsewhere() {
        if (std::this_thread::get_id() != caller) {
            elsewhere = true;
            taken.set_value();
        }
        return elsewhere;
    }

    std::thread::id caller = std::this_thread::get_id();
    std::promise<void> taken;
    std::atomic<bool> elsewhere = false;
    std::atomic<bool> ended = false;
    std::thread::id answered_on;
    boost::system::error_code code;
    std::string body;
    std::string why;
};

[[noreturn, gnu::cold]] void throw_not_alone() {
    throw error(errc::would_deadlock, "another thread runs the service's context: start async_request there, with "
                                      "boost::asio::co_spawn or boost::asio::post");
}

} // namespace

std::string service::request(std::string_view command, const call_options& options) {
    const auto* own = engine_->executor().target<asio::io_context::executor_type>();
    if (own == nullptr) {
        throw error(errc::would_deadlock, "the blocking form needs a service on an io_context, which it runs");
    }
    auto* io = &static_cast<asio::io_context&>(own->context());
    if (own->running_in_this_thread()) {
        throw error(errc::would_deadlock, "inside a handler, co_await async_request instead");
    }
    const auto result = std::make_shared<blocking_outcome>();
    auto asked = options;
    asked.diagnostics(result->why);
    asio::post(engine_->executor(), [this, result, asked, text = std::string{command}] {
        if (result->is_elsewhere()) {
            return;
        }
        async_request(text, asked, [result](boost::system::error_code code, const json_text& reply) {
            result->code = code;
            result->body = reply.text;
            result->answered_on = std::this_thread::get_id();
            result->ended = true;
        });
    });
    // A thread that waits in `run` takes this at once.
    if (!std::exchange(alone_, false) &&
        result->taken.get_future().wait_for(time_to_take) == std::future_status::ready) {
        throw_not_alone();
    }
    io->restart();
    while (!result->ended) {
        if (io->run_one_for(time_to_look) == 0 && io->stopped()) {
            throw error(errc::stopped, "the context was stopped before the answer was received");
        }
        if (result->elsewhere) {
            throw_not_alone();
        }
    }
    alone_ = result->answered_on == result->caller;
    if (options.diagnostics_ != nullptr && !result->why.empty()) {
        *options.diagnostics_ = result->why;
    }
    if (result->code) {
        throw error(result->code, result->why);
    }
    return std::move(result->body);
}

} // namespace cles
