// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/cancellation.hpp>
#include <cles/coroutine_handler.hpp>
#include <cles/error.hpp>
#include <cles/feed.hpp>
#include <cles/gossip.hpp>
#include <cles/identity.hpp>
#include <cles/limits.hpp>
#include <cles/log.hpp>
#include <cles/multicast.hpp>
#include <cles/peer.hpp>
#include <cles/pending.hpp>
#include <cles/registrar.hpp>
#include <cles/reply_operation.hpp>
#include <cles/routing.hpp>
#include <cles/short_text.hpp>
#include <cles/standard.hpp>

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/associated_cancellation_slot.hpp>
#include <boost/asio/async_result.hpp>
#include <boost/asio/execution_context.hpp>

#include <chrono>
#include <concepts>
#include <cstdint>
#include <functional>
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

namespace cles {

/// How a service is set up. Everything but the name may be left out.
struct service_options {
    std::string name{};                         ///< 1 to 64 letters, digits, '_', '-', '.'; not self, any, all
    std::vector<std::string> listen{};          ///< link URLs, see docs/links.md; none: it only asks
    std::map<std::string, std::string> peers{}; ///< where other nodes are: name to URL
    bool insecure = false;                      ///< allow listening beyond this host without credentials
    /// Networks ("10.0.0.0/8", "fd00::/8") whose hosts are who they say, so that as much is sent to them by UDP as they
    /// ask for. All others but loopback get less than 64 KiB a second, lest the node be used to flood a third party.
    std::vector<std::string> networks{};
    /// Whether and where it takes part in multicast; beyond loopback only where it is `insecure` too.
    multicast_options multicast{};
    /// Finds other nodes by asking, without multicast and beyond its reach, where it is `cles::gossip({seeds})`.
    gossip_options gossip{};
    /// The pool that it belongs to, a name; empty: the one without a name. Nodes of other pools are not known, so that
    /// two that share a network, or a port that was used again, never become one.
    std::string pool{};
    /// Called on the service's executor when another live node turns out to have had this one's name first (of two that
    /// started within a second, the one with the lower epoch has it), with the URL where that one is. The service goes
    /// on, and is not asked by its name.
    std::function<void(std::string_view where)> on_name_taken{};
    /// Acts for its clients on `any:`, `all:` and the names of other nodes (docs/routing.md) where it is
    /// `cles::routing()`. Without it these are answered `no_target`.
    const detail::routing_part* routing = nullptr;
    /// How much this node has to do, as it tells others and is weighed by for `any:`; called on the service's executor,
    /// often, and so to be quick. Where it is empty: the handlers that have not answered, and no pool of workers.
    std::function<node_load()> load{};
    cles::limits limits{};
    authoriser authorise{}; ///< nobody is refused where it is empty
    log_sink log{};
    /// Adds what the program counts to the reply of `PULL self:cles/metrics`: called within its object, for keys and
    /// values of other names. It must neither throw nor block.
    std::function<void(json_writer&)> metrics{};
};

namespace detail {

class engine; // the service's inside

/// What stands where a completion token is expected, and is none of the options that may come before it.
template <class T>
concept token = !std::derived_from<std::remove_cvref_t<T>, call_options>;

inline const call_options no_options{};

/// A body to send, or why it cannot be.
struct outgoing_body {
    std::string text{};
    boost::system::error_code wrong{};
};

struct outgoing {
    cles::verb verb = verb::pull;
    std::string_view noun;
    std::string_view body;
};

// What a cancellation slot holds of an operation.

struct withdrawal {
    std::weak_ptr<engine> service;
    std::uint64_t ticket;

    void operator()() const;
};

/// Of one that begins on the service's executor, while its slot is emitted on another.
struct remote_withdrawal {
    std::weak_ptr<engine> service;
    boost::asio::any_io_executor executor; ///< the service's, on which the other members are used
    std::shared_ptr<std::uint64_t> ticket; ///< 0 before it has begun

    void operator()() const;
};

/// Of an `async_bind`.
struct bind_withdrawal {
    std::shared_ptr<std::weak_ptr<feed_control>> feed; ///< empty before it has begun
    boost::asio::any_io_executor executor;             ///< the service's, where the slot is emitted on another

    void operator()() const;
};

} // namespace detail

/// A node of the network inside an application (paper, sections 3.3 and 3.4): it serves tasks, publishes, and asks
/// others.
///
/// It runs on the executor that it is given, starts no thread and takes no lock. All functions are to be called, and
/// all handlers are called, on that executor; where several threads run it, hand in a strand. Operations whose handler
/// has an associated executor of its own may be begun, and withdrawn, there, as by a coroutine of another context:
/// they hop to the service's executor, and their handlers are called on their own. The service must outlive neither
/// its operations nor its feeds: when it goes, they fail with `stopped`.
///
/// Of a `thread_pool` the service takes a strand itself. Then operations may be begun on any thread, and the other
/// functions too: they run on the strand, and wait for it (on the pool's own threads, which are not to wait, they throw
/// `would_deadlock`). `stop` and the destructor are the exception: call them on the service's executor, or when the
/// pool has been joined.
///
/// Failures. Operations complete with `(error_code, result)`; the peer's own words go to `call_options::diagnostics`.
/// With `co_await` (the default token) and `use_future`, bound to an executor or not, or begun after `asio::deferred`,
/// they throw `cles::error`, which holds code and words. A body that cannot be written as JSON completes its operation
/// with `conversion`.
///
/// Cancellation. All operations honour their cancellation slot (terminal, partial, total) until they complete: the
/// request is withdrawn at the peer and completes with `cancelled` without waiting for it.
///
/// Handlers. A completion handler is never called from inside the function that began, withdrew or ended its operation
/// (an emission, `stop`, `feed::close`, a destructor), and may do anything: throw (it comes out of the executor's
/// `run`, as with Asio's operations, and harms no other operation; call `run` again), cancel, begin, destroy the
/// service. What the functions of `service_options` throw is caught: `authorise` then denies, `load` and `metrics` are
/// left out, and what `log` throws is dropped.
class service : public registrar {
  public:
    /// Starts listening at once; accepting begins when the executor runs.
    /// \throws cles::error: `invalid_name`, `invalid_url` (of a network or multicast group too), `unknown_scheme`,
    /// `insecure_listen`, `invalid_option` (a limit, gossip), or the system's code where an address or interface cannot
    /// be had (the message names it)
    service(boost::asio::any_io_executor executor, service_options options);
    template <std::derived_from<boost::asio::execution_context> Context>
    service(Context& context, service_options options)
        : service(boost::asio::any_io_executor{context.get_executor()}, std::move(options)) {}
    ~service() override;

    [[nodiscard]] const std::string& name() const noexcept;
    /// Where it listens, as URLs with the ports that were given.
    [[nodiscard]] std::vector<std::string> endpoints() const;
    [[nodiscard]] const boost::asio::any_io_executor& get_executor() const noexcept;

    /// Listens at one more URL and returns it as it turned out (with its port). Throws as the constructor does.
    std::string listen(std::string_view url);
    /// Says where a node is. An empty URL forgets it.
    void set_peer(std::string_view name, std::string_view url);
    /// Takes part in gossip from now on, with these seeds instead of those that were given before.
    /// \throws cles::error: `invalid_url`, `unknown_scheme`, `invalid_option`
    void set_gossip(const gossip_options& how);
    /// The other nodes that announce themselves to the multicast group, or of which others tell, by name. Requests to
    /// them need no URL; what `service_options::peers` and `set_peer` say goes first.
    [[nodiscard]] std::vector<peer> peers() const;
    /// Tells the others that this node leaves: they forget its name, and no `any:` or `all:` of theirs reaches it any
    /// more. What is asked on links that are there, or at its URL, is answered as before, so that work can be brought
    /// to its end before `stop`, which does this too. Repeating it does nothing.
    void leave();
    /// Ends in order, so that nobody loses a request: `leave`s, lets no more links in, answers what has been begun (for
    /// `limit` at most; what is left is then `unavailable`) and whatever else comes with `busy`, says on each link that
    /// what has not been answered by then has not been begun, and completes when the links have ended, a second after
    /// that at the latest (`limits::discard`): `void(error_code)`. `stop` is to follow; where it comes before, the code
    /// is `stopped`. Withdrawn, it waits no longer, and nothing new is begun all the same.
    template <class Token = boost::asio::use_awaitable_t<>>
    auto async_close(std::chrono::milliseconds limit, Token&& token = {}) {
        return boost::asio::async_initiate<Token, detail::signature_for<Token>>(
            [this](auto handler, std::chrono::milliseconds at_most) {
                const auto slot = boost::asio::get_associated_cancellation_slot(handler);
                auto* operation = make_operation<void, Token>(std::move(handler), nullptr);
                if (hops(*operation)) {
                    close_elsewhere(hopping(slot), at_most, detail::pending_ptr{operation});
                } else {
                    connect_cancellation(slot, close(*engine_, at_most, detail::pending_ptr{operation}));
                }
            },
            token, limit);
    }
    /// Ends everything: listeners, links, feeds; operations fail with `stopped`, handlers that still run are told to
    /// stop. Answers already given and updates already published are sent first, where the peer takes them at once.
    /// Repeating it does nothing.
    void stop();

    void add(registration task) override;
    [[nodiscard]] publisher make_publisher() override;

    /// Publishes a value to all that are bound to the task (or to "task/parameter/..."), and keeps it as the last one.
    /// Opens the task for BIND. Never blocks: what a slow binder does not take in time is dropped for it, and it is
    /// told. One alone, 100 us or more behind the last, is written in this call; those that come together are written
    /// together, soon after, and what a handler publishes before it first waits behind an answer that it gives then.
    /// \throws cles::error: `invalid_name`, `too_large`, `busy` (all the nouns there may be are bound, or no memory is
    /// left), `failed` (begins like a failure, or is written while a value of the noun is), `conversion` (text that is
    /// not UTF-8)
    template <class T>
    void update(std::string_view noun, const T& value) {
        publish(noun, [&](json_writer& w) { write_json(w, value); });
    }

    /// Forgets the last value of what was published there; who binds it next is answered `{}`. Those that are bound
    /// stay bound, and have what was published before. False where there is no value.
    ///
    /// A task whose nouns come and go ("session/17") need not retire them: past `limits::nouns`, or the memory that
    /// there is for values, the nouns that nobody is bound to retire by themselves, the one used longest ago first.
    bool retire(std::string_view noun);

    /// Publishes once every binder's queue has room, so that nothing is dropped: `void(error_code)`. It completes when
    /// the update is in those queues, in the order of the calls. Withdrawn before, it is not published.
    template <class T, class Token = boost::asio::use_awaitable_t<>>
    auto async_update(std::string_view noun, const T& value, Token&& token = {}) {
        return boost::asio::async_initiate<Token, detail::signature_for<Token>>(
            [this](auto handler, std::string path, const detail::outgoing_body& json) {
                const auto slot = boost::asio::get_associated_cancellation_slot(handler);
                auto* operation = make_operation<void, Token>(std::move(handler), nullptr);
                if (json.wrong) {
                    fail_later(detail::pending_ptr{operation}, json);
                } else if (hops(*operation)) {
                    publish_elsewhere(hopping(slot), path, json.text, detail::pending_ptr{operation});
                } else {
                    connect_cancellation(slot,
                                         publish_when_room(*engine_, path, json.text, detail::pending_ptr{operation}));
                }
            },
            token, std::string{noun}, converted([&] { return to_json(value); }));
    }

    /// Any request, as a command of the language: "PULL car0:localization", "PUSH car0:notice {\"text\":\"hi\"}". The
    /// result is the reply's JSON.
    template <detail::token Token = boost::asio::use_awaitable_t<>>
    auto async_request(std::string_view command, Token&& token = {}) {
        return async_request(command, call_options{}, std::forward<Token>(token));
    }
    template <class Token = boost::asio::use_awaitable_t<>>
    auto async_request(std::string_view command, const call_options& options, Token&& token = {}) {
        return initiate_command<json_text>(command, options, std::forward<Token>(token));
    }

    /// PULL: gets data once.
    template <class T = json_text, detail::token Token = boost::asio::use_awaitable_t<>>
    auto async_pull(std::string_view noun, Token&& token = {}) {
        return initiate<T>(verb::pull, noun, {}, std::cref(detail::no_options), std::forward<Token>(token));
    }
    template <class T = json_text, class Token = boost::asio::use_awaitable_t<>>
    auto async_pull(std::string_view noun, const call_options& options, Token&& token = {}) {
        return initiate<T>(verb::pull, noun, {}, options, std::forward<Token>(token));
    }

    /// PUSH: sends data; completes when its handler has run. Scalars travel as {"value":x}.
    template <class T = json_text, class B, detail::token Token = boost::asio::use_awaitable_t<>>
    auto async_push(std::string_view noun, const B& body, Token&& token = {}) {
        return initiate<T>(verb::push, noun, body_text(body), std::cref(detail::no_options),
                           std::forward<Token>(token));
    }
    template <class T = json_text, class B, class Token = boost::asio::use_awaitable_t<>>
    auto async_push(std::string_view noun, const B& body, const call_options& options, Token&& token = {}) {
        return initiate<T>(verb::push, noun, body_text(body), options, std::forward<Token>(token));
    }

    /// DELEGATE: sends data, gets the result of a task; see `call_options::on_progress`.
    template <class T = json_text, class B, detail::token Token = boost::asio::use_awaitable_t<>>
    auto async_delegate(std::string_view noun, const B& body, Token&& token = {}) {
        return initiate<T>(verb::delegate, noun, body_text(body), std::cref(detail::no_options),
                           std::forward<Token>(token));
    }
    template <class T = json_text, class B, class Token = boost::asio::use_awaitable_t<>>
    auto async_delegate(std::string_view noun, const B& body, const call_options& options, Token&& token = {}) {
        return initiate<T>(verb::delegate, noun, body_text(body), options, std::forward<Token>(token));
    }

#if defined(__GNUC__) && !defined(__clang__) && __GNUC__ < 13
    // Chosen for a temporary aggregate that needs its destructor, in a call that is awaited.
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

    /// BIND: a feed of updates. Completes when the publisher has answered.
    template <class T = json_text, detail::token Token = boost::asio::use_awaitable_t<>>
    auto async_bind(std::string_view noun, Token&& token = {}) {
        return async_bind<T>(noun, bind_options{}, std::forward<Token>(token));
    }
    template <class T = json_text, class Token = boost::asio::use_awaitable_t<>>
    auto async_bind(std::string_view noun, const bind_options& options, Token&& token = {}) {
        return boost::asio::async_initiate<Token, detail::signature_for<Token, feed<T>>>(
            [this](auto handler, const std::string& target, const bind_options& chosen) {
                this->template start_bind<T, Token>(std::move(handler), target, chosen);
            },
            token, std::string{noun}, options);
    }

    /// The blocking form, for a host without coroutines: runs the context until the answer is there. Only for an
    /// `io_context` that no other thread runs.
    /// \throws cles::error as above; `would_deadlock` inside a handler
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
    auto* make_operation(Handler handler, std::string* diagnostics) {
        using operation_type = detail::reply_operation<T, detail::throws<std::remove_cvref_t<Token>>, Handler>;
        return detail::make_operation<operation_type>(std::move(handler), get_executor(), diagnostics);
    }

    // The noun and the options are kept by the operation, which may begin later: the noun without allocation where it
    // is short, the options as they are, or by reference where they are nobody's.
    template <class T, class Token, class Options>
    auto initiate(cles::verb verb, std::string_view noun, detail::outgoing_body body, const Options& options,
                  Token&& token) {
        return boost::asio::async_initiate<Token, detail::signature_for<Token, T>>(
            [this, verb](auto handler, const detail::short_text& target, const detail::outgoing_body& content,
                         const call_options& chosen) {
                auto slot = boost::asio::get_associated_cancellation_slot(handler);
                auto* operation = make_operation<T, Token>(std::move(handler), chosen.diagnostics_);
                if (content.wrong) {
                    fail_later(detail::pending_ptr{operation}, content);
                } else if (hops(*operation)) {
                    send_elsewhere(hopping(slot), {verb, target.view(), content.text}, chosen,
                                   detail::pending_ptr{operation});
                } else {
                    connect_cancellation(slot, send(*engine_, {verb, target.view(), content.text}, chosen,
                                                    detail::pending_ptr{operation}));
                }
            },
            token, detail::short_text{noun}, std::move(body), options);
    }

    template <class T, class Token>
    auto initiate_command(std::string_view command, const call_options& options, Token&& token) {
        return boost::asio::async_initiate<Token, detail::signature_for<Token, T>>(
            [this](auto handler, const std::string& text, const call_options& chosen) {
                auto slot = boost::asio::get_associated_cancellation_slot(handler);
                auto* operation = make_operation<T, Token>(std::move(handler), chosen.diagnostics_);
                if (hops(*operation)) {
                    send_command_elsewhere(hopping(slot), text, chosen, detail::pending_ptr{operation});
                } else {
                    connect_cancellation(slot, send_command(*engine_, text, chosen, detail::pending_ptr{operation}));
                }
            },
            token, std::string{command}, options);
    }

    /// Whether an operation is begun on another executor than the service's: by its handler's, or, where the service
    /// has made a strand of its own, by where this is called.
    template <class Operation>
    [[nodiscard]] bool hops(const Operation& operation) const noexcept {
        return operation.elsewhere() || (pooled_ && !on_strand());
    }

    template <class Slot>
    void connect_cancellation(Slot slot, std::uint64_t ticket) {
        if (ticket != 0) {
            detail::connect_slot(slot, detail::withdrawal{engine_, ticket});
        }
    }

    /// The slot's connection to an operation that begins on the service's executor, and may end before this returns.
    template <class Slot>
    detail::remote_withdrawal hopping(Slot slot) {
        detail::remote_withdrawal withdraw{engine_, get_executor(), std::make_shared<std::uint64_t>(0)};
        detail::connect_slot(slot, withdraw);
        return withdraw;
    }

    template <class T, class Token, class Handler>
    void start_bind(Handler handler, const std::string& noun, const bind_options& options) {
        using operation_type = detail::bind_operation<T, detail::throws<std::remove_cvref_t<Token>>, Handler>;
        const auto slot = boost::asio::get_associated_cancellation_slot(handler);
        auto* operation =
            detail::make_operation<operation_type>(std::move(handler), get_executor(), options.diagnostics_);
        const detail::bind_withdrawal withdraw{std::make_shared<std::weak_ptr<detail::feed_control>>(),
                                               hops(*operation) ? get_executor() : boost::asio::any_io_executor{}};
        detail::connect_slot(slot, withdraw);
        start_bind(withdraw, detail::binding_ptr{operation}, noun, options);
    }

    void fail_later(detail::pending_ptr operation, const detail::outgoing_body& why);
    void publish(std::string_view noun, const std::function<void(json_writer&)>& write);
    // These return a ticket by which the operation can be withdrawn; 0 where it has been completed or queued for it.
    static std::uint64_t send(detail::engine& inside, const detail::outgoing& request, const call_options& options,
                              detail::pending_ptr operation);
    static std::uint64_t send_command(detail::engine& inside, std::string_view command, const call_options& options,
                                      detail::pending_ptr operation);
    static std::uint64_t publish_when_room(detail::engine& inside, std::string_view noun, std::string_view json,
                                           detail::pending_ptr operation);
    static std::uint64_t close(detail::engine& inside, std::chrono::milliseconds limit, detail::pending_ptr operation);
    // The same on the service's executor, where they set the ticket.
    void send_elsewhere(const detail::remote_withdrawal& withdraw, const detail::outgoing& request,
                        const call_options& options, detail::pending_ptr operation);
    void send_command_elsewhere(const detail::remote_withdrawal& withdraw, const std::string& command,
                                const call_options& options, detail::pending_ptr operation);
    void publish_elsewhere(const detail::remote_withdrawal& withdraw, const std::string& noun, const std::string& json,
                           detail::pending_ptr operation);
    void close_elsewhere(const detail::remote_withdrawal& withdraw, std::chrono::milliseconds limit,
                         detail::pending_ptr operation);
    void start_bind(const detail::bind_withdrawal& withdraw, detail::binding_ptr operation, const std::string& noun,
                    const bind_options& options);
    static std::shared_ptr<detail::feed_control> make_feed(const std::shared_ptr<detail::engine>& inside,
                                                           std::string_view noun, const bind_options& options);
    [[nodiscard]] bool on_strand() const noexcept;

    std::shared_ptr<detail::engine> engine_;
    bool pooled_; ///< it has made a strand of a pool
};

} // namespace cles
