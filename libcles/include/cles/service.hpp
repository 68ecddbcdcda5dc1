// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/call_shape.hpp>
#include <cles/cancellation.hpp>
#include <cles/chrono.hpp>
#include <cles/convert.hpp>
#include <cles/coroutine_handler.hpp>
#include <cles/error.hpp>
#include <cles/feed.hpp>
#include <cles/gossip.hpp>
#include <cles/identity.hpp>
#include <cles/limits.hpp>
#include <cles/log.hpp>
#include <cles/multicast.hpp>
#include <cles/parameter.hpp>
#include <cles/peer.hpp>
#include <cles/pending.hpp>
#include <cles/registrar.hpp>
#include <cles/reply_operation.hpp>
#include <cles/routing.hpp>
#include <cles/short_text.hpp>
#include <cles/standard.hpp>
#include <cles/text_list.hpp>

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/associated_cancellation_slot.hpp>
#include <boost/asio/async_result.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/execution_context.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/version.hpp>

#include <concepts>
#include <cstdint>
#include <exception>
#include <functional>
#include <initializer_list>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#if !defined(BOOST_ASIO_NO_DEPRECATED)
#error                                                                                                                 \
    "CLES is compiled with BOOST_ASIO_NO_DEPRECATED, and so must be its users: the target cles::cles of CMake and the \
flags of pkg-config's cles define it"
#endif

namespace boost::asio {
class io_context;
}

namespace cles {

namespace asio_port {
class asio_environment;
} // namespace asio_port

namespace core {
struct node_options;
} // namespace core

namespace detail {
/// Adds to a service's environment and to the settings of its node. As a function, it adds less to programs without one
/// than an object would.
using service_part = std::function<void(asio_port::asio_environment&, core::node_options&)>;
struct jobs_part;
struct tracing_part;
struct types_part;
} // namespace detail

/// URLs of nodes, by name. A std::map that the library copies, assigns and destroys, so that a user's file compiles
/// less.
struct peer_urls : std::map<std::string, std::string> {
    using map::map;
    peer_urls() = default;
    peer_urls(std::initializer_list<value_type> urls);
    peer_urls(const map& urls);
    peer_urls(map&& urls) noexcept;
    peer_urls(const peer_urls& other);
    peer_urls(peer_urls&& other) noexcept;
    peer_urls& operator=(const peer_urls& other);
    peer_urls& operator=(peer_urls&& other) noexcept;
    ~peer_urls();
};
template <std::same_as<peer_urls> Urls>
struct converter<Urls> : converter<typename Urls::map> {}; // a template: convert_containers.hpp may be missing

/// The configuration of a service. Only the name is required.
struct service_options {
    std::string name{};    ///< 1 to 64 letters, digits, '_', '-', '.'; not self, any, all
    text_list listen{};    ///< link URLs, see docs/links.md; none: it does not listen
    peer_urls peers{};     ///< URLs of other nodes, by name
    bool insecure = false; ///< allow listening beyond this host without credentials
    /// `cles::secured(directory)` authenticates all peers and encrypts what is sent to other hosts
    /// (<cles/security.hpp>, docs/security.md). Each service needs its own.
    detail::service_part security{};
    /// Networks ("10.0.0.0/8", "fd00::/8") whose source addresses are trusted, so the amount sent to them by UDP is not
    /// limited. All other hosts except loopback are sent less than 64 KiB a second, so that the node cannot be used to
    /// flood a third party.
    text_list networks{};
    /// Multicast. Beyond loopback only if `insecure` is set too.
    multicast_options multicast{};
    /// `cles::gossip({seeds})` finds other nodes by gossip, without multicast and beyond its reach.
    gossip_options gossip{};
    /// The name of the pool that it belongs to; empty: the unnamed pool. Nodes of other pools are ignored, so two pools
    /// that share a network or reuse a port stay separate.
    std::string pool{};
    /// `cles::federation({...})` joins the pool to others through NATS (<cles/federation.hpp>, docs/federation.md).
    /// Each service needs its own.
    detail::service_part federation{};
    /// Called on the service's executor when another live node had this node's name first (of two that started within a
    /// second, the one with the lower epoch has it), with that node's URL. The service continues, but receives no
    /// requests by its name.
    std::function<void(std::string_view where)> on_name_taken{};
    /// `cles::routing()` forwards requests of clients to `any:`, `all:` and other nodes (docs/routing.md). If null,
    /// these fail with `no_target`.
    const detail::routing_part* routing = nullptr;
    /// `cles::tracing()` records how long traced requests take here (<cles/tracing.hpp>). If null, the identity of a
    /// trace is only passed on.
    const detail::tracing_part* tracing = nullptr;
    /// `cles::types()` tells others the types of the node's tasks, and its nouns (<cles/types.hpp>). If null, requests
    /// for them fail with `no_task`.
    const detail::types_part* types = nullptr;
    /// `cles::jobs()` lists the jobs of this node to others, who may cancel them, and tells how long its tasks take
    /// (<cles/jobs.hpp>). If null, requests for that fail with `no_task`.
    const detail::jobs_part* jobs = nullptr;
    /// Returns the load of this node, which is reported to others and used to balance `any:`. Called often, on the
    /// service's executor, so it must be quick. If empty, the load is the number of unfinished handlers, without a pool
    /// of workers.
    std::function<node_load()> load{};
    cles::limits limits{};
    authoriser authorise{}; ///< if empty, nothing is denied
    log_sink log{};
    /// Adds the program's own metrics to the reply of `PULL self:cles/metrics`: called inside the JSON object, for keys
    /// that are not used yet, and their values. It must neither throw nor block.
    std::function<void(json_writer&)> metrics{};
};

class service;

namespace detail {

class engine; // the implementation of the service
struct sharing_access;

/// A completion token, as opposed to the options that may precede it.
template <class T>
concept token = !std::derived_from<std::remove_cvref_t<T>, call_options>;

const call_options& no_options() noexcept;

/// A body to send, or why it cannot be sent.
struct outgoing_body {
    std::string text{};
    boost::system::error_code wrong{};
};

struct request_kind {
    cles::verb verb = verb::pull;
    bool is_command = false; ///< whether the noun is a whole command instead
};

struct outgoing {
    request_kind kind;
    std::string_view noun;
    const outgoing_body& body;
};

struct late_start; // an operation that starts later, on the service's executor

/// Cancels an operation. Called by the slot of its handler.
struct withdrawal {
    std::weak_ptr<engine> service{};    ///< of an operation that has started
    std::uint64_t ticket = 0;           ///< its number
    std::shared_ptr<late_start> late{}; ///< if it starts later

    void operator()() const;
};

/// The cancellation slot of a handler, of any type; the slot must outlive it.
class slot_ref {
  public:
    template <class Slot>
    explicit slot_ref(Slot& slot) noexcept : slot_(&slot), assign_(&assign_slot<Slot>) {}
    void assign(withdrawal withdraw) const { assign_(slot_, std::move(withdraw)); }

  private:
    template <class Slot>
    static void assign_slot(void* slot, withdrawal withdraw) {
        detail::connect_slot(*static_cast<Slot*>(slot), std::move(withdraw));
    }

    void* slot_;
    void (*assign_)(void* slot, withdrawal withdraw);
};
extern template void slot_ref::assign_slot<boost::asio::cancellation_slot>(void* slot, withdrawal withdraw);

/// An operation that is about to start. \tparam Pointer owns it
template <class Pointer>
struct starting {
    Pointer operation;
    bool elsewhere; ///< whether its handler has another executor than the service
    slot_ref slot;
};

template <class Operation, class Slot>
starting<pending_ptr> about_to_start(Operation* operation, Slot& slot) noexcept {
    return {pending_ptr{operation}, operation->elsewhere(), slot_ref{slot}};
}

/// A request that a coroutine awaits, as Asio awaits operations. Refers to memory of the coroutine.
struct awaited_request {
    service& from;
    outgoing request;
    const call_options& options;
    reply_target target;

    template <boost::asio::completion_token_for<void(std::exception_ptr)> Token>
    auto operator()(Token&& token) {
        return boost::asio::async_initiate<Token, void(std::exception_ptr)>(
            [this](auto handler) { this->start(std::move(handler)); }, token);
    }

  private:
    template <class Handler>
    void start(Handler handler);
};

/// Awaits a request with the default token. There is less to compile than for other tokens, because only this depends
/// on the type of the result. A class, because g++ warns about the frame of a function for a type without linkage.
template <class T, class Options>
struct reply_coroutine {
    static boost::asio::awaitable<T> run(service& from, request_kind kind, short_text noun, outgoing_body body,
                                         Options options);
};
// Outside the class, so that it is not inline: inline functions are compiled in spite of `extern template`.
template <class T, class Options>
boost::asio::awaitable<T> reply_coroutine<T, Options>::run(service& from, request_kind kind, short_text noun,
                                                           outgoing_body body, Options options) {
    reply_carrier<T> value{};
    const call_options& chosen = options;
    awaited_request request{
        from, {kind, noun.view(), body}, chosen, {std::addressof(value), read_reply<T>, chosen.diagnostics_}};
    co_await std::move(request); // NOLINT(performance-move-const-arg): Asio awaits rvalues
    if constexpr (comes_wrapped<T>) {
        co_return std::move(value.value);
    } else {
        co_return std::move(value);
    }
}

/// Awaits a binding with the default token; as `reply_coroutine`.
template <class T>
struct bind_coroutine {
    static boost::asio::awaitable<feed<T>> run(service& from, std::string noun, bind_options options);
};

} // namespace detail

/// A node of the network inside an application (paper, sections 3.3 and 3.4): it serves tasks, publishes, and sends
/// requests.
///
/// Executor. The service runs on the executor that it is given, starts no thread and takes no lock. Call all functions
/// on that executor; all handlers are called there. If several threads run it, pass a strand. Operations whose handler
/// has another associated executor, such as a coroutine of another context, may be started and cancelled on that
/// executor: they are dispatched to the service's executor, and their handlers are called on their own.
///
/// Lifetime. Operations and feeds may outlive the service: when it is destroyed, they fail with `stopped`. A child
/// process that ends after `fork` leaves the service of its parent as it is (docs/library_reference.md).
///
/// Thread pools. For a `thread_pool`, the service makes a strand itself. Then operations may be started on any thread.
/// The other functions may be called on any thread too: they run on the strand and block until done (on the pool's own
/// threads, which must not block, they throw `would_deadlock`). Exceptions are `stop` and the destructor: call them on
/// the service's executor, or after the pool has been joined.
///
/// Failures. Operations complete with `(error_code, result)`; the peer's message is written to
/// `call_options::diagnostics`. With `co_await` (the default token) and `use_future`, also if bound to an executor or
/// started after `asio::deferred`, they throw `cles::error`, which contains code and message. If a body cannot be
/// written as JSON, its operation fails with `conversion`.
///
/// Cancellation. All operations support cancellation (terminal, partial, total) until they complete: the request is
/// cancelled at the peer, and completes with `cancelled` without waiting for the peer.
///
/// Handlers. A completion handler is never called inside the function that starts, cancels or ends its operation (an
/// emission, `stop`, `feed::close`, a destructor). It may throw (the exception leaves the executor's `run`, as with
/// Asio's operations, and affects no other operation; call `run` again), cancel and start operations, and destroy the
/// service. Exceptions from the functions of `service_options` are caught: `authorise` then denies, `load` and
/// `metrics` are left out, and what `log` throws is dropped.
class service : public registrar {
  public:
    /// Starts listening at once; accepts links when the executor runs.
    /// \throws cles::error: `invalid_name`, `invalid_url` (also of a network or multicast group), `unknown_scheme`,
    /// `insecure_listen`, `invalid_option` (limits, gossip), or the system's code if an address or interface is not
    /// available (the message names it)
    service(boost::asio::any_io_executor executor, const service_options& options);
    service(boost::asio::io_context& context, const service_options& options);
    template <std::derived_from<boost::asio::execution_context> Context>
    service(Context& context, const service_options& options)
        : service(boost::asio::any_io_executor{context.get_executor()}, options) {}
    ~service() override;

    [[nodiscard]] const std::string& name() const noexcept;
    /// The URLs that it listens on, with the actual ports.
    [[nodiscard]] std::vector<std::string> endpoints() const;
    [[nodiscard]] const boost::asio::any_io_executor& get_executor() const noexcept;

    /// Listens on another URL and returns it with the actual port. Throws as the constructor does.
    std::string listen(std::string_view url);
    /// Sets the URL of a node. An empty URL removes it.
    void set_peer(std::string_view name, std::string_view url);
    /// Starts gossip with these seeds and links, or replaces both.
    /// \throws cles::error: `invalid_url`, `unknown_scheme`, `invalid_option`
    void set_gossip(const gossip_options& how);
    /// The other nodes known from multicast or gossip, by name. Requests to them need no URL; those in
    /// `service_options::peers` and `set_peer` take precedence.
    [[nodiscard]] std::vector<peer> peers() const;
    /// Announces that this node leaves: others forget its name, and no longer route `any:` and `all:` requests to it.
    /// Requests on existing links, or to its URL, are still served, so work can be completed before `stop`, which calls
    /// this too. Idempotent.
    void leave();
    /// Shuts down gracefully: calls `leave`, accepts no more links, sends the updates that have been published and
    /// replies to requests that have started (for at most `limit`; subscribers that are slower miss updates, the other
    /// requests fail with `unavailable`), and to new requests with `busy`. Then tells the peers that any
    /// request without a reply has not been started, and completes when the links have ended, at most a second later
    /// (`limits::discard`): `void(error_code)`. Call `stop` afterwards; if it is called earlier, the code is `stopped`.
    /// Cancellation ends the wait, but new requests are still not started.
    template <class Token = boost::asio::use_awaitable_t<>>
    auto async_close(std::chrono::milliseconds limit, Token&& token = {}) {
        if constexpr (!detail::fits_token<Token>()) {
            return detail::refuse_call<Token, void>();
        } else if constexpr (detail::is_default_token<Token>) {
            return await_close(limit);
        } else {
            return initiate_plain(&service::start_close, std::forward<Token>(token), limit);
        }
    }
    /// Ends all listeners, links and feeds. Operations fail with `stopped`, and running handlers are notified to stop.
    /// Replies and updates that are already queued are sent first, as far as the peer accepts them at once. Idempotent.
    /// In a child process it does nothing, unless the child has called `notify_fork` of the context.
    void stop();

    void add(registration task) override;
    /// Stops offering a task: from now on its requests fail with `no_task`, and other nodes are told. Requests that
    /// have started are still answered. What it has published stays (`retire`). False if there is no such task.
    bool remove(cles::verb verb, std::string_view task);
    [[nodiscard]] publisher make_publisher() override;

    /// Publishes a value to all subscribers of the task (or of "task/parameter/..."), and keeps it as the last value.
    /// Also opens the task for BIND. Never blocks: updates that a slow subscriber does not accept in time are dropped
    /// for that subscriber, which is notified. A single update, at least 100 us after the previous one, is written in
    /// this call. Updates in quick succession are written together, soon after. If a handler replies before it first
    /// suspends, its reply is written before the updates that it has published.
    /// \throws cles::error: `invalid_name`, `too_large`, `busy` (the maximum number of nouns is bound, or no memory is
    /// left), `failed` (the value begins like a failure, or is being written while another value of the noun is),
    /// `conversion` (text that is not UTF-8, brackets nested deeper than 35 levels)
    template <class T>
    void update(std::string_view noun, const T& value) {
        publish(noun, [&](json_writer& w) { detail::write_content(w, value); });
    }

    /// Forgets the last value of a noun; later subscribers receive `{}`. Existing subscribers stay bound, and still
    /// receive what was published before. False if there is no value.
    ///
    /// Tasks with many short-lived nouns ("session/17") need not call this: beyond `limits::nouns`, or the memory for
    /// values, nouns without subscribers are retired automatically, least recently used first.
    bool retire(std::string_view noun);
    /// The same for all nouns of a task. Returns how many values there were.
    std::size_t retire_all(std::string_view task);

    /// Publishes when every subscriber's queue has space, so that nothing is dropped: `void(error_code)`. It completes
    /// when the update is in all queues, in the order of the calls. If it is cancelled earlier, the update is not
    /// published.
    template <class T, class Token = boost::asio::use_awaitable_t<>>
    auto async_update(std::string_view noun, const T& value, Token&& token = {}) {
        if constexpr (!detail::fits_token<Token>()) {
            return detail::refuse_call<Token, void>();
        } else if constexpr (detail::is_default_token<Token>) {
            return await_update(std::string{noun}, converted([&] { return detail::to_content(value); }));
        } else {
            return initiate_plain(&service::start_update, std::forward<Token>(token), std::string{noun},
                                  converted([&] { return detail::to_content(value); }));
        }
    }

    /// Sends any request, as a command of the language: "PULL car0:localization", "PUSH car0:notice {\"text\":\"hi\"}".
    /// The result is the reply's JSON. The command's own JSON may have several lines; it is sent as one.
    template <detail::token Token = boost::asio::use_awaitable_t<>>
    auto async_request(std::string_view command, Token&& token = {}) {
        return initiate<json_text>({.is_command = true}, command, {}, std::cref(detail::no_options()),
                                   std::forward<Token>(token));
    }
    template <class Token = boost::asio::use_awaitable_t<>>
    auto async_request(std::string_view command, const call_options& options, Token&& token = {}) {
        return initiate<json_text>({.is_command = true}, command, {}, options, std::forward<Token>(token));
    }

    /// PULL: gets data once.
    template <class T = json_text, detail::token Token = boost::asio::use_awaitable_t<>>
    auto async_pull(std::string_view noun, Token&& token = {}) {
        return initiate<T>({verb::pull}, noun, {}, std::cref(detail::no_options()), std::forward<Token>(token));
    }
    template <class T = json_text, class Token = boost::asio::use_awaitable_t<>>
    auto async_pull(std::string_view noun, const call_options& options, Token&& token = {}) {
        return initiate<T>({verb::pull}, noun, {}, options, std::forward<Token>(token));
    }

    /// PUSH: sends data; completes when its handler has run. Scalars are sent as {"value":x}.
    template <class T = json_text, class B, detail::token Token = boost::asio::use_awaitable_t<>>
    auto async_push(std::string_view noun, const B& body, Token&& token = {}) {
        return initiate<T>({verb::push}, noun, body_text(body), std::cref(detail::no_options()),
                           std::forward<Token>(token));
    }
    template <class T = json_text, class B, class Token = boost::asio::use_awaitable_t<>>
    auto async_push(std::string_view noun, const B& body, const call_options& options, Token&& token = {}) {
        return initiate<T>({verb::push}, noun, body_text(body), options, std::forward<Token>(token));
    }

    /// DELEGATE: sends data, gets the result of a task; see `call_options::on_progress`.
    template <class T = json_text, class B, detail::token Token = boost::asio::use_awaitable_t<>>
    auto async_delegate(std::string_view noun, const B& body, Token&& token = {}) {
        return initiate<T>({verb::delegate}, noun, body_text(body), std::cref(detail::no_options()),
                           std::forward<Token>(token));
    }
    template <class T = json_text, class B, class Token = boost::asio::use_awaitable_t<>>
    auto async_delegate(std::string_view noun, const B& body, const call_options& options, Token&& token = {}) {
        return initiate<T>({verb::delegate}, noun, body_text(body), options, std::forward<Token>(token));
    }

#if defined(__GNUC__) && !defined(__clang__) && __GNUC__ < 13
    // Selected for a temporary aggregate with a non-trivial destructor, in a call that is awaited.
    template <class T = json_text, detail::fragile_temporary B, class... Rest>
        requires(detail::awaited_call<Rest...>::value)
    auto async_push(std::string_view noun, B&& body, Rest&&... rest) {
        refuse_temporary<B>();
        return async_push<T>(noun, std::as_const(body), std::forward<Rest>(rest)...);
    }
    template <class T = json_text, detail::fragile_temporary B, class... Rest>
        requires(detail::awaited_call<Rest...>::value)
    auto async_delegate(std::string_view noun, B&& body, Rest&&... rest) {
        refuse_temporary<B>();
        return async_delegate<T>(noun, std::as_const(body), std::forward<Rest>(rest)...);
    }
    template <detail::fragile_temporary T, class... Rest>
        requires(detail::awaited_call<Rest...>::value)
    auto async_update(std::string_view noun, T&& value, Rest&&... rest) {
        refuse_temporary<T>();
        return async_update(noun, std::as_const(value), std::forward<Rest>(rest)...);
    }
#endif

    /// BIND: returns a feed of updates. Completes when the publisher has replied.
    template <class T = json_text, detail::token Token = boost::asio::use_awaitable_t<>>
    auto async_bind(std::string_view noun, Token&& token = {}) {
        return async_bind<T>(noun, bind_options{}, std::forward<Token>(token));
    }
    template <class T = json_text, class Token = boost::asio::use_awaitable_t<>>
    auto async_bind(std::string_view noun, const bind_options& options, Token&& token = {}) {
        if constexpr (!detail::fits_answer<T>()) {
            return detail::refuse_call<Token, feed<json_text>>();
        } else if constexpr (!detail::fits_token<Token, feed<T>>()) {
            return detail::refuse_call<Token, feed<T>>();
        } else if constexpr (detail::is_default_token<Token>) {
            return detail::bind_coroutine<T>::run(*this, std::string{noun}, options);
        } else {
            return boost::asio::async_initiate<Token, detail::signature_for<Token, feed<T>>>(
                [this](auto handler, const std::string& target, const bind_options& chosen) {
                    using operation_type =
                        detail::bind_operation<T, detail::throws<std::remove_cvref_t<Token>>, decltype(handler)>;
                    this->template start_bind<operation_type>(std::move(handler), target, chosen);
                },
                token, std::string{noun}, options);
        }
    }

    /// The blocking form, for programs without coroutines: runs the context until the reply arrives. Only for an
    /// `io_context` that no other thread runs.
    /// \throws cles::error as above; `would_deadlock` inside a handler, and if another thread runs the context
    std::string request(std::string_view command, const call_options& options = {});

  private:
    template <class B>
    static void refuse_temporary() {
        static_assert(!detail::fragile_temporary<B>,
                      "g++ 12 destroys a temporary aggregate twice where the call is awaited: name it first "
                      "(const note text{...}; co_await node.async_push(noun, text)), or give its type a constructor");
    }

    template <class F>
    static detail::outgoing_body converted(F convert) {
        try {
            return {.text = convert()};
        } catch (const error& e) {
            return {.text = e.message(), .wrong = e.code()};
        }
    }

    template <class B>
    static detail::outgoing_body body_text(const B& body) {
        return converted([&] { return detail::to_body(body); });
    }

    template <class T, class Token, class Handler>
    auto* new_operation(Handler handler, std::string* diagnostics) {
        using operation_type = detail::reply_operation<T, detail::throws<std::remove_cvref_t<Token>>, Handler>;
        return detail::make_operation<operation_type>(std::move(handler), get_executor(), diagnostics);
    }

    // The operation keeps the noun and the options, because it may start later: a short noun without allocation, and
    // options by value, or by reference if they are the defaults.
    template <class T, class Token, class Options>
    auto initiate(detail::request_kind kind, std::string_view noun, detail::outgoing_body body, const Options& options,
                  Token&& token) {
        if constexpr (!detail::fits_call<Token, T>()) {
            return detail::refuse_call<Token, T>();
        } else if constexpr (detail::is_default_token<Token>) {
            return detail::reply_coroutine<T, Options>::run(*this, kind, detail::short_text{noun}, std::move(body),
                                                            options);
        } else {
            return boost::asio::async_initiate<Token, detail::signature_for<Token, T>>(
                [this, kind](auto handler, const detail::short_text& target, const detail::outgoing_body& content,
                             const call_options& chosen) {
                    auto slot = boost::asio::get_associated_cancellation_slot(handler);
                    auto* operation = new_operation<T, Token>(std::move(handler), chosen.diagnostics_);
                    start(detail::about_to_start(operation, slot), {kind, target.view(), content}, chosen);
                },
                token, detail::short_text{noun}, std::move(body), options);
        }
    }

    template <class Operation, class Handler, class... A>
    void start_bind(Handler handler, const std::string& noun, const bind_options& options, A&... arguments) {
        auto slot = boost::asio::get_associated_cancellation_slot(handler);
        auto* operation =
            detail::make_operation<Operation>(std::move(handler), get_executor(), options.diagnostics_, arguments...);
        start_bind({detail::binding_ptr{operation}, operation->elsewhere(), detail::slot_ref{slot}}, noun, options);
    }

    /// Initiates an operation without a result, which `begin` starts.
    template <class Token, class... A>
    auto initiate_plain(void (service::*begin)(detail::starting<detail::pending_ptr>, const A&...), Token&& token,
                        std::type_identity_t<A>... arguments) {
        return boost::asio::async_initiate<Token, detail::signature_for<Token>>(
            [this, begin](auto handler, const A&... kept) {
                auto slot = boost::asio::get_associated_cancellation_slot(handler);
                auto* operation = new_operation<void, Token>(std::move(handler), nullptr);
                (this->*begin)(detail::about_to_start(operation, slot), kept...);
            },
            token, std::move(arguments)...);
    }

    // With the default token, compiled in the library.
    boost::asio::awaitable<void> await_update(std::string noun, detail::outgoing_body json);
    boost::asio::awaitable<void> await_close(std::chrono::milliseconds limit);
    boost::asio::awaitable<void> await_bind(const std::string& noun, const bind_options& options,
                                            detail::feed_owner& bound);

    void publish(std::string_view noun, const std::function<void(json_writer&)>& write);

    using starting = detail::starting<detail::pending_ptr>;
    // They start the operation on the service's executor, now or later, and connect its slot.
    void start(starting what, const detail::outgoing& request, const call_options& options);
    void start_update(starting what, const std::string& noun, const detail::outgoing_body& json);
    void start_close(starting what, const std::chrono::milliseconds& limit);
    void start_bind(detail::starting<detail::binding_ptr> what, const std::string& noun, const bind_options& options);
    template <class Start>
    void start_here(const detail::slot_ref& slot, const Start& start);
    template <class Start>
    void start_elsewhere(const detail::slot_ref& slot, Start start);
    /// Whether an operation has to be dispatched to the service's executor: because its handler has another one, or, if
    /// the service has made a strand, because the caller is not on it.
    [[nodiscard]] bool hops(bool elsewhere) const noexcept { return elsewhere || (pooled_ && !on_strand()); }
    [[nodiscard]] bool on_strand() const noexcept;
    /// Runs it on the strand that was made of a pool, and waits for it; inline if there is none.
    template <class F>
    std::invoke_result_t<F> run_inside(F f) const;

    friend detail::awaited_request;
    friend detail::sharing_access;
    template <class T>
    friend struct detail::bind_coroutine;

    std::shared_ptr<detail::engine> engine_;
    bool pooled_;        ///< whether it has made a strand of a pool
    bool alone_ = false; ///< whether the last blocking request found no other thread that runs the context
};

template <class T>
boost::asio::awaitable<feed<T>> detail::bind_coroutine<T>::run(service& from, std::string noun, bind_options options) {
    feed_owner bound;
    co_await from.await_bind(noun, options, bound);
    co_return feed<T>{std::move(bound)};
}

// The library contains these, so that its users need not compile them.
extern template struct detail::reply_coroutine<json_text, call_options>;
extern template struct detail::reply_coroutine<json_text, std::reference_wrapper<const call_options>>;
extern template struct detail::bind_coroutine<json_text>;

} // namespace cles

// As for awaited_next in feed.hpp.
#if BOOST_VERSION < 108900
extern template void cles::detail::awaited_request::start(
    boost::asio::detail::awaitable_async_op_handler<void(std::exception_ptr), boost::asio::any_io_executor> handler);
#else
#include <cles/awaited_operation.hpp>
#endif
