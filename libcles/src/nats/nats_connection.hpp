// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "nats/tls_watch.hpp"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

struct __natsConnection;   // NOLINT(bugprone-reserved-identifier): as libnats declares it
struct __natsOptions;      // NOLINT(bugprone-reserved-identifier)
struct __natsSubscription; // NOLINT(bugprone-reserved-identifier)

namespace cles::nats {

/// Where NATS is, and what is shown to it.
struct server_options {
    std::vector<std::string> servers;
    std::string name; ///< of the client, for the server's monitoring
    std::string credentials;
    std::string token;
    std::string tls_authority;
    std::string tls_certificate;
    std::string tls_key;
};

/// What has happened, in order.
struct event {
    enum class kind : std::uint8_t {
        connected,    ///< `max_message` and `connection` are set
        disconnected, ///< `text`: why
        refused,      ///< an attempt to connect failed; `text`: why
        problem,      ///< `text`: what the server does not permit
        message       ///< `subject`, `reply` and `text` are set
    };
    kind what = kind::message;
    std::string subject{};
    std::string reply{};
    std::string text{};
    std::size_t max_message = 0;
    std::uint64_t connection = 0; ///< its number
};

/// A connection to NATS on a thread of its own, which connects again whenever the connection is lost, after growing
/// pauses. Each connection begins without subscriptions, and what was meant for an earlier one is dropped: nothing is
/// sent twice.
///
/// Its functions are called on one thread, the executor's, and do not block. The end of the handle waits until what was
/// published has been sent, but not for an attempt to connect, which may take as long as the system's resolver: then
/// the thread ends later, on its own.
class nats_connection {
  public:
    static constexpr std::size_t max_unsent = 4U << 20U;
    static constexpr std::size_t max_untaken = 4U << 20U;

    struct ending {
        std::shared_ptr<nats_connection> shared; // with the thread
        void operator()(nats_connection* which) const { which->end(); }
    };
    using handle = std::unique_ptr<nats_connection, ending>;
    /// \param wake called on another thread when there are events, until `stop`
    /// \throws cles::error if the system refuses a descriptor or the thread
    static handle start(server_options options, std::function<void()> wake);
    nats_connection(const nats_connection&) = delete;
    nats_connection& operator=(const nats_connection&) = delete;
    ~nats_connection();

    /// The executor has noticed this connection: what follows is meant for it.
    void use(std::uint64_t connection) noexcept { used_ = connection; }
    /// Ends the connection, and makes another one.
    void reconnect() noexcept;
    /// Returns false if too much waits to be sent.
    bool publish(std::string subject, std::string reply, std::string text);
    /// \param group the queue group; empty: none \param bulk messages that may be dropped if too many wait to be taken
    void subscribe(std::string subject, std::string group, bool bulk);
    /// Messages of a subscription that is not bulk still arrive if the server has sent them before it knows.
    void unsubscribe(std::string subject);
    /// Has the thread send what was published.
    void flush();
    /// What has happened since the last call.
    std::vector<event> take();
    /// Bytes that the server has not been sent yet.
    [[nodiscard]] std::size_t unsent() const noexcept { return queued_.load() + buffered_.load(); }
    /// Bytes that were given to it, ever. They are sent in this order.
    [[nodiscard]] std::uint64_t given() const noexcept { return given_; }
    /// Messages of subscriptions that were dropped.
    [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_.load(); }
    /// Sends what waits, and ends. `wake` is not called any more.
    void stop() noexcept;

  private:
    struct command {
        enum class kind : std::uint8_t { publish, subscribe, subscribe_bulk, unsubscribe };
        kind what;
        std::string subject;
        std::string reply{}; // or the queue group
        std::string text{};
        std::uint64_t connection = 0; // for which it is meant

        [[nodiscard]] std::size_t size() const noexcept { return subject.size() + reply.size() + text.size() + 16; }
    };
    struct callbacks;
    friend struct callbacks;

    nats_connection(server_options options, std::function<void()> wake);
    void end();
    void run();
    std::string connect();
    std::string configure(__natsOptions* made);
    std::string serve();
    bool apply_commands();
    void apply(const command& c);
    void unsubscribe_now(const std::string& subject);
    void collect();
    void put(event e);
    void put_bulk(event e);
    void put_locked(event e);
    void disconnect();
    void send_rest();
    void pause(std::chrono::milliseconds time);
    void signal() const noexcept;
    void enqueue(command c);
    [[nodiscard]] bool wants_more();
    [[nodiscard]] bool takes_more() const;

    const server_options options_;
    const int wake_descriptor_;
    const std::uintptr_t number_; // in the registry of those that the library may call

    // Of the executor.
    std::uint64_t given_ = 0;
    std::uint64_t used_ = 0; // connection

    std::mutex mutex_; // guards what follows
    std::function<void()> wake_;
    std::vector<command> commands_;
    std::vector<event> events_;
    std::size_t untaken_ = 0;
    bool waking_ = false;
    bool is_full_ = false;
    bool is_connecting_ = false;
    bool has_ended_ = false;
    std::condition_variable changed_; // the last two

    std::atomic<std::size_t> queued_{0};
    std::atomic<std::size_t> buffered_{0};
    std::atomic<std::uint64_t> dropped_{0};
    std::atomic<bool> stopped_{false};
    std::atomic<bool> closed_{false};
    std::atomic<bool> renews_{false};
    std::atomic<bool> wants_write_{false};
    std::atomic<int> socket_{-1};
    std::atomic<std::thread::id> own_thread_{};

    // Of the thread.
    __natsConnection* connection_ = nullptr;
    std::uint64_t connection_number_ = 0;
    tls_watch tls_;
    std::map<std::string, __natsSubscription*, std::less<>> subscriptions_;
    std::vector<__natsSubscription*> polled_;
    std::vector<__natsSubscription*> draining_; // of these, those that have been ended
};

} // namespace cles::nats
