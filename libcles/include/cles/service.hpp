// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
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

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/async_result.hpp>
#include <boost/asio/execution_context.hpp>

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

#if !defined(BOOST_ASIO_SEPARATE_COMPILATION) || !defined(BOOST_ASIO_NO_DEPRECATED)
#error                                                                                                                 \
    "CLES is compiled with BOOST_ASIO_SEPARATE_COMPILATION and BOOST_ASIO_NO_DEPRECATED, and so must be whoever uses \
it: the target cles::cles of CMake and the flags of pkg-config's cles set them"
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

struct outgoing {
    cles::verb verb = verb::pull;
    std::string_view noun;
    std::string_view body;
};

} // namespace detail

/// A node of the network inside an application (paper, sections 3.3 and 3.4): it serves tasks, publishes, and asks
/// others.
///
/// It runs on the executor that it is given, starts no thread and takes no lock. All functions are to be called, and
/// all handlers are called, on that executor; where several threads run it, hand in a strand (for a `thread_pool` the
/// service takes one itself). Handlers of operations are called on their own associated executor. The service must
/// outlive neither its operations nor its feeds: when it goes, they fail with `stopped`.
///
/// Failures. Operations complete with `(error_code, result)`; the peer's own words go to `call_options::diagnostics`.
/// With `co_await` (the default token) and `use_future` they throw `cles::error`, which holds code and words.
///
/// Cancellation. All operations honour their cancellation slot (terminal, partial, total): the request is withdrawn at
/// the peer and completes with `cancelled` at once.
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
    /// left), `failed` (begins like a failure, or is written while a value of the noun is)
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
    /// the update is in those queues, in the order of the calls.
    template <class T, class Token = boost::asio::use_awaitable_t<>>
    auto async_update(std::string_view noun, const T& value, Token&& token = {}) {
        return boost::asio::async_initiate<Token, detail::signature_for<Token>>(
            [this](auto handler, std::string path, std::string json) {
                auto* operation = make_operation<void, Token>(std::move(handler), nullptr);
                publish_when_room(path, json, detail::pending_ptr{operation});
            },
            token, std::string{noun}, to_json(value));
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
    static std::string body_text(const B& body) {
        if constexpr (detail::comes_wrapped<B> || std::convertible_to<const B&, std::string_view>) {
            std::string out;
            json_writer writer{out};
            writer.begin_object();
            writer.key("value");
            write_json(writer, body);
            writer.end_object();
            return out;
        } else {
            return to_json(body);
        }
    }

    template <class T, class Token, class Handler>
    auto* make_operation(Handler handler, std::string* diagnostics) {
        using operation_type = detail::reply_operation<T, detail::throws<std::remove_cvref_t<Token>>, Handler>;
        return detail::make_operation<operation_type>(std::move(handler), get_executor(), diagnostics);
    }

    // The noun and the options are kept by the operation, which may begin later: the noun without allocation where it
    // is short, the options as they are, or by reference where they are nobody's.
    template <class T, class Token, class Options>
    auto initiate(cles::verb verb, std::string_view noun, std::string body, const Options& options, Token&& token) {
        return boost::asio::async_initiate<Token, detail::signature_for<Token, T>>(
            [this, verb](auto handler, const detail::short_text& target, const std::string& text,
                         const call_options& chosen) {
                auto slot = boost::asio::get_associated_cancellation_slot(handler);
                auto* operation = make_operation<T, Token>(std::move(handler), chosen.diagnostics_);
                connect_cancellation(slot, send({verb, target.view(), text}, chosen, detail::pending_ptr{operation}));
            },
            token, detail::short_text{noun}, std::move(body), options);
    }

    template <class T, class Token>
    auto initiate_command(std::string_view command, const call_options& options, Token&& token) {
        return boost::asio::async_initiate<Token, detail::signature_for<Token, T>>(
            [this](auto handler, const std::string& text, const call_options& chosen) {
                auto slot = boost::asio::get_associated_cancellation_slot(handler);
                auto* operation = make_operation<T, Token>(std::move(handler), chosen.diagnostics_);
                connect_cancellation(slot, send_command(text, chosen, detail::pending_ptr{operation}));
            },
            token, std::string{command}, options);
    }

    template <class Slot>
    void connect_cancellation(Slot slot, std::uint64_t ticket) {
        if (ticket != 0 && slot.is_connected()) {
            slot.assign([weak = std::weak_ptr{engine_}, ticket](boost::asio::cancellation_type type) {
                const auto alive = weak.lock();
                if (alive && type != boost::asio::cancellation_type::none) {
                    cancel(*alive, ticket);
                }
            });
        }
    }

    template <class T, class Token, class Handler>
    void start_bind(Handler handler, const std::string& noun, const bind_options& options) {
        using operation_type = detail::bind_operation<T, detail::throws<std::remove_cvref_t<Token>>, Handler>;
        auto control = make_feed(noun, options);
        auto slot = boost::asio::get_associated_cancellation_slot(handler);
        if (slot.is_connected()) {
            slot.assign([weak = std::weak_ptr{control}](boost::asio::cancellation_type type) {
                const auto alive = weak.lock();
                if (alive && type != boost::asio::cancellation_type::none) {
                    alive->close();
                }
            });
        }
        control->start(detail::pending_ptr{
            detail::make_operation<operation_type>(std::move(handler), get_executor(), control, options.diagnostics_)});
    }

    void publish(std::string_view noun, const std::function<void(json_writer&)>& write);
    void publish_when_room(std::string_view noun, std::string_view json, detail::pending_ptr operation);
    // Both return a ticket by which the operation can be withdrawn; 0 where it has been completed or queued for it.
    std::uint64_t send(const detail::outgoing& request, const call_options& options, detail::pending_ptr operation);
    std::uint64_t send_command(std::string_view command, const call_options& options, detail::pending_ptr operation);
    static void cancel(detail::engine& inside, std::uint64_t ticket);
    std::shared_ptr<detail::feed_control> make_feed(std::string_view noun, const bind_options& options);

    std::shared_ptr<detail::engine> engine_;
};

} // namespace cles
