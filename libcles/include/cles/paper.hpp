// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_value.hpp>
#include <cles/service.hpp>

#include <boost/json/object.hpp>
#include <boost/json/serialize.hpp>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

/// The interface of the paper, with the names of its Listing 1.1; docs/paper.md compares it with the native one.
///
/// ```
/// CLES_Service device1("device1", "127.0.0.1", 25370);
/// device1.registerPullFunction("systemTime", getSystemTime);
/// device1.run();
/// CLES_Response time = device2.makeCLESRequest("PULL device1:systemTime/UTC");
/// ```

namespace cles::paper {

/// A command of the language: "PULL device1:systemTime/UTC". Adverbs and a JSON body may follow.
using CLES_Request = std::string;
/// Key-value pairs. A reply that is an array is the value of the key "value", as a scalar is.
using CLES_Response = boost::json::object;

/// A service with a thread of its own. Nodes find each other by name, as those of `cles serve` do: by multicast on
/// loopback, with keys on all interfaces, or on those that CLES_MULTICAST names.
///
/// Functions take `()`, `(std::vector<std::string>)` or `(std::vector<std::string>, CLES_Response)`: the parameters,
/// and the data of PUSH, DELEGATE and UPDATE. One that can be called in several of these ways gets most. They return
/// nothing, a `CLES_Response` or any result that
/// `<cles/convert.hpp>` writes. The service's thread runs them, one at a time. What they throw becomes the reply.
///
/// Any thread may call the members. In a function of the service, requests fail with `would_deadlock`, and `stop` does
/// not wait. Destroy the service on another thread than its own.
class CLES_Service {
  public:
    /// Listens for TCP at an address of this host, or at the first IPv4 address of a named interface. Beyond loopback
    /// it uses TLS, with the keys in the directory CLES_KEYS (an environment variable); link cles::tls then.
    /// \throws cles::error as `cles::service` does: beyond loopback, without CLES_KEYS, `insecure_listen`
    CLES_Service(const std::string& deviceName, const std::string& interface, std::uint16_t port);
    CLES_Service(const CLES_Service&) = delete;
    CLES_Service& operator=(const CLES_Service&) = delete;
    ~CLES_Service();

    // These return false if the name is invalid, or has a function for that verb already.

    template <class F>
    bool registerPullFunction(std::string_view name, F function) {
        return add(verb::pull, name, adapted(std::move(function)));
    }
    template <class F>
    bool registerPushFunction(std::string_view name, F function) {
        return add(verb::push, name, adapted(std::move(function)));
    }
    template <class F>
    bool registerDelegateFunction(std::string_view name, F function) {
        return add(verb::delegate, name, adapted(std::move(function)));
    }
    /// Runs at each BIND, which it refuses by throwing; its result is ignored.
    template <class F>
    bool registerBindFunction(std::string_view name, F function) {
        return add(verb::bind, name, adapted(std::move(function)));
    }
    /// Runs at each update of what this service has bound of a task of that name, beginning with the last value; what
    /// it throws then is ignored. Also runs when a node requests an UPDATE of this service's task.
    template <class F>
    bool registerUpdateFunction(std::string_view name, F function) {
        return add(verb::update, name, adapted(std::move(function)));
    }

    /// Starts the thread, and returns. \throws cles::error with `stopped` after `stop`
    void run();
    /// Ends all links and bindings, and waits for the thread. Requests that still wait fail with `stopped`. Idempotent.
    void stop();
    /// Sends a command and waits for the reply. Before `run`, the service runs in this call.
    ///
    /// The reply to a BIND has no pairs: the function of `registerUpdateFunction` gets the last value and each update.
    /// A second BIND of a noun replaces the first, and one with `lease=0` ends it. An UPDATE of a task of this service
    /// publishes.
    /// \throws cles::error: the peer's; `would_deadlock`; `stopped`; `bad_request`, also if no function gets the
    /// updates
    CLES_Response makeCLESRequest(const CLES_Request& request);

    /// For what the listing leaves out, such as `set_peer` and `endpoints`: before `run`, or in functions.
    [[nodiscard]] cles::service& native() noexcept;

  private:
    bool add(verb how, std::string_view task, plain_handler function);
    static CLES_Response pairs_of(std::string_view json);

    template <class F>
    static plain_handler adapted(F function) {
        using texts = std::vector<std::string>;
        constexpr bool none = std::is_invocable_v<F&>, one = std::is_invocable_v<F&, texts>,
                       both = std::is_invocable_v<F&, texts, CLES_Response>;
        static_assert(none || one || both,
                      "a function of the paper's interface takes (), (std::vector<std::string>) or "
                      "(std::vector<std::string>, CLES_Response)");
        const auto call = [](F& f, const request& r) {
            if constexpr (both) {
                return f(texts(r.parameters().begin(), r.parameters().end()), pairs_of(r.body()));
            } else if constexpr (one) {
                return f(texts(r.parameters().begin(), r.parameters().end()));
            } else if constexpr (none) {
                return f();
            }
        };
        using result = decltype(call(function, std::declval<const request&>()));
        return cles::detail::copyable([f = std::move(function), call](const request& r, json_writer& w) mutable {
            if constexpr (std::is_void_v<result>) {
                call(f, r);
            } else if constexpr (cles::detail::fits_result<result>()) {
                cles::detail::write_content(w, call(f, r));
            }
        });
    }

    struct parts;
    std::unique_ptr<parts> parts_;
};

} // namespace cles::paper

// As the listing is printed: without a namespace.
using cles::paper::CLES_Request;
using cles::paper::CLES_Response;
using cles::paper::CLES_Service;
