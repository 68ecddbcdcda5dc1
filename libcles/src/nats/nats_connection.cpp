// SPDX-License-Identifier: BSL-1.0
#include "nats/nats_connection.hpp"

#include <cles/error.hpp>

#include <boost/system/error_code.hpp>
#include <boost/system/system_error.hpp>

#include <nats/nats.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <memory>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

namespace cles::nats {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds connect_timeout{1'000}; // of one server
constexpr std::int64_t ping_interval = 2'000;  // milliseconds
constexpr int max_pings_out = 2;
constexpr milliseconds first_pause{250};
constexpr milliseconds longest_pause{1'000};
constexpr milliseconds flush_at_end{200};
constexpr milliseconds drain_timeout{500};
constexpr int most_buffered = 1 << 20; // bytes that the library holds; more wait here

// What the library may call after its connection has been destroyed here.
struct registry {
    std::mutex mutex;
    std::map<std::uintptr_t, nats_connection*> entries;
    std::uintptr_t last = 0;
};

registry& known() {
    static auto* const instance = new registry; // the library's threads may outlive static objects
    return *instance;
}

std::uintptr_t enter(nats_connection* which) {
    auto& all = known();
    const std::lock_guard lock{all.mutex};
    all.entries.emplace(++all.last, which);
    return all.last;
}

void leave(std::uintptr_t number) {
    auto& all = known();
    const std::lock_guard lock{all.mutex};
    all.entries.erase(number);
}

template <class F>
void with(void* number, F f) {
    auto& all = known();
    const std::lock_guard lock{all.mutex};
    if (const auto found = all.entries.find(reinterpret_cast<std::uintptr_t>(number)); found != all.entries.end()) {
        f(*found->second);
    }
}

std::string last_error(natsStatus code) {
    const char* const words = nats_GetLastError(nullptr);
    std::string_view text = words != nullptr && *words != '\0' ? words : natsStatus_GetText(code);
    constexpr std::string_view end_of_place = "): "; // in the library's sources
    if (const auto end = text.find(end_of_place); text.starts_with('(') && end != std::string_view::npos) {
        text.remove_prefix(end + end_of_place.size());
    }
    return std::string{text};
}

// The library does not pass on everything that it is told.
std::string refusal(std::string said) {
    if (said.find("Expected 'PONG', got ''") != std::string::npos) {
        const auto why = tls_watch::last_error(); // a certificate is refused after the handshake
        return why.empty() ? "the server ended the connection at once: it may have its maximum of connections"
                           : "the server ended the connection at once: " + why;
    }
    if (said.find("SSL handshake error: (null)") != std::string::npos) {
        return "SSL handshake error: the server does not answer";
    }
    if (said == "SSL_write error: (null)" || said == "SSL_read error: (null)") {
        return "the server ended the connection after the TLS handshake: it may not accept the certificate, or miss "
               "one";
    }
    return said;
}

struct close_file {
    void operator()(std::FILE* file) const noexcept { std::fclose(file); }
};

// Null if it cannot be read. Programs that other threads start meanwhile do not inherit it.
std::unique_ptr<std::FILE, close_file> open_file(const std::string& file) {
    return std::unique_ptr<std::FILE, close_file>{std::fopen(file.c_str(), "re")};
}

// Empty if it can be read.
std::string why_unreadable(const std::string& file) {
    return open_file(file) ? std::string{} : "cannot read " + file + ": " + std::generic_category().message(errno);
}

std::string first_line_of(const std::string& file) {
    std::string line;
    if (const auto opened = open_file(file)) {
        for (int c = std::fgetc(opened.get()); c != EOF && c != '\n'; c = std::fgetc(opened.get())) {
            line.push_back(static_cast<char>(c));
        }
    }
    return line;
}

std::string to_text(const char* text) { return text == nullptr ? std::string{} : std::string{text}; }

event message_of(natsMsg* from) {
    event made{.what = event::kind::message,
               .subject = to_text(natsMsg_GetSubject(from)),
               .reply = to_text(natsMsg_GetReply(from)),
               .text = std::string(natsMsg_GetData(from) == nullptr ? "" : natsMsg_GetData(from),
                                   static_cast<std::size_t>(natsMsg_GetDataLength(from)))};
    natsMsg_Destroy(from);
    return made;
}

int make_descriptor() {
    const int made = ::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (made < 0) {
        throw boost::system::system_error(errno, boost::system::system_category(), "eventfd");
    }
    return made;
}

} // namespace

/// What the library calls: as an event loop, and with messages.
struct nats_connection::callbacks {
    static natsStatus attach(void** data, void* loop, natsConnection*, natsSock socket) {
        *data = loop;
        // The library opens it without. While the connection is made, a child would still inherit it.
        ::fcntl(socket, F_SETFD, FD_CLOEXEC);
        with(loop, [socket](nats_connection& c) { c.socket_ = socket; });
        return NATS_OK;
    }
    static natsStatus read(void* loop, bool add) {
        if (!add) { // the connection is being closed
            with(loop, [](nats_connection& c) {
                c.closed_ = true;
                c.signal();
            });
        }
        return NATS_OK;
    }
    static natsStatus write(void* loop, bool add) {
        with(loop, [add](nats_connection& c) {
            c.wants_write_ = add;
            if (add && std::this_thread::get_id() != c.own_thread_.load()) {
                c.signal();
            }
        });
        return NATS_OK;
    }
    static natsStatus detach(void* loop) {
        with(loop, [](nats_connection& c) {
            c.closed_ = true;
            c.socket_ = -1;
            c.signal();
        });
        return NATS_OK;
    }
    static void error(natsConnection* connection, natsSubscription*, natsStatus code, void* loop) {
        const char* words = nullptr;
        natsConnection_GetLastError(connection, &words);
        std::string text = words != nullptr && *words != '\0' ? words : natsStatus_GetText(code);
        if (code == NATS_SLOW_CONSUMER) {
            text = "messages were dropped, because this node is too slow for them";
        }
        with(loop, [&text](nats_connection& c) { c.put({.what = event::kind::problem, .text = std::move(text)}); });
    }
    static void bulk(natsConnection*, natsSubscription*, natsMsg* message, void* loop) {
        auto made = message_of(message);
        with(loop, [&made](nats_connection& c) { c.put_bulk(std::move(made)); });
    }
};

nats_connection::nats_connection(server_options options, std::function<void()> wake)
    : options_(std::move(options)), wake_descriptor_(make_descriptor()), number_(enter(this)), wake_(std::move(wake)),
      tls_(connect_timeout) {}

nats_connection::~nats_connection() {
    leave(number_);
    ::close(wake_descriptor_);
}

nats_connection::handle nats_connection::start(server_options options, std::function<void()> wake) {
    tls_watch::keep_openssl();
    const std::shared_ptr<nats_connection> made{new nats_connection{std::move(options), std::move(wake)}};
    try {
        std::thread{[made] { made->run(); }}.detach();
    } catch (const std::system_error& e) {
        throw error(e.code(), "cannot start the thread that is connected to NATS: " + e.code().message());
    }
    return handle{made.get(), ending{made}};
}

void nats_connection::end() {
    stop();
    std::unique_lock lock{mutex_};
    changed_.wait(lock, [this] { return has_ended_ || is_connecting_; });
}

// -- on the executor -----------------------------------------------------------------------------------------------

void nats_connection::stop() noexcept {
    {
        const std::lock_guard lock{mutex_};
        wake_ = nullptr;
    }
    stopped_ = true;
    signal();
}

void nats_connection::enqueue(command c) {
    const auto size = c.size();
    given_ += size;
    c.connection = used_;
    const std::lock_guard lock{mutex_};
    commands_.push_back(std::move(c));
    queued_ += size;
}

bool nats_connection::publish(std::string subject, std::string reply, std::string text) {
    if (unsent() > max_unsent) {
        return false;
    }
    enqueue({.what = command::kind::publish,
             .subject = std::move(subject),
             .reply = std::move(reply),
             .text = std::move(text)});
    return true;
}

void nats_connection::subscribe(std::string subject, std::string group, bool bulk) {
    enqueue({.what = bulk ? command::kind::subscribe_bulk : command::kind::subscribe,
             .subject = std::move(subject),
             .reply = std::move(group)});
}

void nats_connection::unsubscribe(std::string subject) {
    enqueue({.what = command::kind::unsubscribe, .subject = std::move(subject)});
}

void nats_connection::flush() {
    if (queued_ != 0) {
        signal();
    }
}

std::vector<event> nats_connection::take() {
    const std::lock_guard lock{mutex_};
    waking_ = false;
    untaken_ = 0;
    if (std::exchange(is_full_, false)) {
        signal();
    }
    return std::exchange(events_, {});
}

void nats_connection::signal() const noexcept {
    const std::uint64_t one = 1;
    static_cast<void>(::write(wake_descriptor_, &one, sizeof one));
}

// -- on any thread -------------------------------------------------------------------------------------------------

void nats_connection::put_locked(event e) {
    untaken_ += e.text.size() + e.subject.size() + e.reply.size() + sizeof(event);
    events_.push_back(std::move(e));
    if (wake_ && !std::exchange(waking_, true)) {
        wake_();
    }
}

void nats_connection::put(event e) {
    const std::lock_guard lock{mutex_};
    put_locked(std::move(e));
}

void nats_connection::put_bulk(event e) {
    const std::lock_guard lock{mutex_};
    if (untaken_ > max_untaken) {
        ++dropped_;
    } else {
        put_locked(std::move(e));
    }
}

// -- on its thread -------------------------------------------------------------------------------------------------

void nats_connection::run() {
    own_thread_ = std::this_thread::get_id();
    auto next_pause = first_pause;
    const auto note = [this](bool& what, bool value) {
        const std::lock_guard lock{mutex_};
        what = value;
        changed_.notify_all();
    };
    while (!stopped_) {
        note(is_connecting_, true);
        auto why = connect();
        note(is_connecting_, false);
        if (!why.empty()) {
            put({.what = event::kind::refused, .text = std::move(why)});
        } else {
            next_pause = first_pause;
            why = serve();
            disconnect();
            if (!stopped_) {
                put({.what = event::kind::disconnected, .text = std::move(why)});
            }
        }
        pause(next_pause);
        next_pause = std::min(next_pause * 2, longest_pause);
    }
    nats_ReleaseThreadMemory();
    note(has_ended_, true);
}

void nats_connection::pause(milliseconds time) {
    const auto until = std::chrono::steady_clock::now() + time;
    while (!stopped_) {
        const auto left = std::chrono::ceil<milliseconds>(until - std::chrono::steady_clock::now());
        if (left.count() <= 0) {
            return;
        }
        pollfd woken{.fd = wake_descriptor_, .events = POLLIN, .revents = 0};
        if (::poll(&woken, 1, static_cast<int>(left.count())) > 0) {
            std::uint64_t ignored = 0;
            static_cast<void>(::read(wake_descriptor_, &ignored, sizeof ignored));
        }
    }
}

// Returns why it cannot be done; empty if it can.
std::string nats_connection::configure(natsOptions* made) {
    std::vector<const char*> servers;
    bool is_secure = !options_.tls_authority.empty() || !options_.tls_certificate.empty();
    for (const auto& server : options_.servers) {
        servers.push_back(server.c_str());
        is_secure = is_secure || server.starts_with("tls://");
    }
    auto* const self = reinterpret_cast<void*>(number_); // NOLINT(performance-no-int-to-ptr): found in the registry
    for (const auto* file : {&options_.token, &options_.credentials, &options_.tls_authority, &options_.tls_certificate,
                             &options_.tls_key}) {
        if (auto why = file->empty() ? std::string{} : why_unreadable(*file); !why.empty()) {
            return why;
        }
    }
    std::string token;
    if (!options_.token.empty()) {
        token = first_line_of(options_.token);
        if (token.empty()) {
            return "cannot read a token from " + options_.token + ": its first line is empty";
        }
    }
    const auto check = [](natsStatus code, const std::string& what) {
        return code == NATS_OK ? std::string{} : what + ": " + last_error(code);
    };
    std::string why;
    const auto step = [&](natsStatus code, const std::string& what) {
        if (why.empty()) {
            why = check(code, what);
        }
    };
    step(natsOptions_SetServers(made, servers.data(), static_cast<int>(servers.size())), "the URL of a server");
    step(natsOptions_SetName(made, options_.name.c_str()), "the name");
    step(natsOptions_SetTimeout(made, connect_timeout.count()), "the time limit");
    // Otherwise a thread of the library asks for it a millisecond later. `apply_commands` writes once for many.
    step(natsOptions_SetSendAsap(made, true), "the buffer");
    step(natsOptions_SetAllowReconnect(made, false), "the connection"); // it would send again what was not sent
    step(natsOptions_SetPingInterval(made, ping_interval), "the interval");
    step(natsOptions_SetMaxPingsOut(made, max_pings_out), "the interval");
    step(natsOptions_UseGlobalMessageDelivery(made, true), "the threads");
    step(natsOptions_DisableNoResponders(made, true), "the replies");
    step(natsOptions_SetErrorHandler(made, &callbacks::error, self), "the handler");
    step(natsOptions_SetEventLoop(made, self, &callbacks::attach, &callbacks::read, &callbacks::write,
                                  &callbacks::detach),
         "the event loop");
    if (!token.empty()) {
        step(natsOptions_SetToken(made, token.c_str()), "the token");
    }
    if (!options_.credentials.empty()) {
        step(natsOptions_SetUserCredentialsFromFiles(made, options_.credentials.c_str(), nullptr),
             options_.credentials);
    }
    if (why.empty() && !tls_.prepare(made, options_.tls_authority.empty())) {
        why = "cannot prepare TLS";
    }
    if (is_secure) {
        step(natsOptions_SetSecure(made, true), "TLS");
    }
    if (!options_.tls_authority.empty()) {
        step(natsOptions_LoadCATrustedCertificates(made, options_.tls_authority.c_str()), options_.tls_authority);
    }
    if (!options_.tls_certificate.empty()) {
        step(natsOptions_LoadCertificatesChain(made, options_.tls_certificate.c_str(), options_.tls_key.c_str()),
             options_.tls_certificate);
    }
    return why;
}

std::string nats_connection::connect() {
    natsOptions* made = nullptr;
    if (const auto code = natsOptions_Create(&made); code != NATS_OK) {
        return last_error(code);
    }
    auto why = configure(made);
    if (why.empty()) {
        renews_ = false; // this one is new
        closed_ = false;
        wants_write_ = false;
        if (const auto code = natsConnection_Connect(&connection_, made); code != NATS_OK) {
            why = refusal(last_error(code));
            connection_ = nullptr;
        }
    }
    natsOptions_Destroy(made);
    if (!why.empty()) {
        return why;
    }
    event connected{.what = event::kind::connected,
                    .max_message = static_cast<std::size_t>(natsConnection_GetMaxPayload(connection_)),
                    .connection = ++connection_number_};
    const std::lock_guard lock{mutex_};
    commands_.clear(); // from before
    queued_ = 0;
    put_locked(std::move(connected));
    return {};
}

void nats_connection::reconnect() noexcept {
    renews_ = true;
    signal();
}

// Returns why it has ended.
std::string nats_connection::serve() {
    while (!stopped_ && !closed_ && !renews_ && !natsConnection_IsClosed(connection_)) {
        const bool all_applied = apply_commands();
        const bool wants_read = wants_more();
        std::array<pollfd, 2> waited{pollfd{.fd = wake_descriptor_, .events = POLLIN, .revents = 0},
                                     pollfd{.fd = socket_,
                                            .events = static_cast<short>((wants_read ? POLLIN | POLLRDHUP : 0) |
                                                                         (wants_write_ || !all_applied ? POLLOUT : 0)),
                                            .revents = 0}};
        if (::poll(waited.data(), waited.size(), -1) < 0 && errno != EINTR) {
            return "poll failed";
        }
        if ((waited[0].revents & POLLIN) != 0) {
            std::uint64_t ignored = 0;
            static_cast<void>(::read(wake_descriptor_, &ignored, sizeof ignored));
        }
        const bool has_ended = (waited[1].revents & (POLLHUP | POLLERR | POLLRDHUP)) != 0;
        const bool is_readable = (waited[1].revents & POLLIN) != 0;
        if (has_ended || (is_readable && (!tls_.is_used() || tls_.has_record(socket_)))) {
            natsConnection_ProcessReadEvent(connection_);
            collect();
        }
        if ((waited[1].revents & POLLOUT) != 0) {
            natsConnection_ProcessWriteEvent(connection_);
        }
    }
    if (stopped_) {
        send_rest();
        return {};
    }
    if (renews_) {
        return "this node is another member of its fleet, or none, and connects again";
    }
    const char* words = nullptr;
    natsConnection_GetLastError(connection_, &words);
    auto why = to_text(words);
    return why.empty() ? std::string{"the server closed it, or does not answer"} : why;
}

bool nats_connection::wants_more() {
    const std::lock_guard lock{mutex_};
    is_full_ = untaken_ > max_untaken;
    return !is_full_;
}

// Returns false if some wait until the socket takes more.
bool nats_connection::apply_commands() {
    for (;;) {
        const auto buffered = natsConnection_Buffered(connection_);
        buffered_ = static_cast<std::size_t>(std::max(buffered, 0));
        if (buffered > most_buffered) {
            return false;
        }
        std::vector<command> taken;
        {
            const std::lock_guard lock{mutex_};
            taken.swap(commands_);
        }
        if (taken.empty()) {
            return true;
        }
        std::size_t bytes = 0;
        for (const auto& c : taken) {
            apply(c);
            bytes += c.size();
        }
        queued_ -= bytes;
        if (wants_write_ && takes_more()) {
            natsConnection_ProcessWriteEvent(connection_);
        }
    }
}

// Whether a write returns at once.
bool nats_connection::takes_more() const {
    pollfd waited{.fd = socket_, .events = POLLOUT, .revents = 0};
    return !tls_.is_used() || ::poll(&waited, 1, 0) > 0;
}

void nats_connection::apply(const command& c) {
    if (c.connection != connection_number_) { // the executor has not noticed yet that this is another one
        return;
    }
    auto* const self = reinterpret_cast<void*>(number_); // NOLINT(performance-no-int-to-ptr): found in the registry
    const auto* const group = c.reply.empty() ? nullptr : c.reply.c_str();
    natsSubscription* made = nullptr;
    natsStatus code = NATS_OK;
    switch (c.what) {
    case command::kind::publish:
        code = group == nullptr ? natsConnection_Publish(connection_, c.subject.c_str(), c.text.data(),
                                                         static_cast<int>(c.text.size()))
                                : natsConnection_PublishRequest(connection_, c.subject.c_str(), group, c.text.data(),
                                                                static_cast<int>(c.text.size()));
        break;
    case command::kind::subscribe:
        code = group == nullptr ? natsConnection_SubscribeSync(&made, connection_, c.subject.c_str())
                                : natsConnection_QueueSubscribeSync(&made, connection_, c.subject.c_str(), group);
        if (code == NATS_OK) {
            natsSubscription_SetPendingLimits(made, -1, -1); // they are taken at once
            polled_.push_back(made);
        }
        break;
    case command::kind::subscribe_bulk:
        code = natsConnection_Subscribe(&made, connection_, c.subject.c_str(), &callbacks::bulk, self);
        break;
    case command::kind::unsubscribe: unsubscribe_now(c.subject); break;
    }
    if (made != nullptr && code == NATS_OK) {
        auto& kept = subscriptions_[c.subject];
        natsSubscription_Destroy(std::exchange(kept, made));
    }
    if (code != NATS_OK && code != NATS_CONNECTION_CLOSED) {
        put({.what = event::kind::problem, .text = c.subject + ": " + last_error(code)});
    }
}

void nats_connection::unsubscribe_now(const std::string& subject) {
    const auto found = subscriptions_.extract(subject);
    if (found.empty()) {
        return;
    }
    auto* const gone = found.mapped();
    if (std::ranges::find(polled_, gone) != polled_.end()) {
        if (natsSubscription_DrainTimeout(gone, drain_timeout.count()) == NATS_OK) {
            draining_.push_back(gone);
            return;
        }
        collect(); // what has arrived
        std::erase(polled_, gone);
    }
    natsSubscription_Destroy(gone);
}

// At once, so that who takes one message takes all that were read with it.
void nats_connection::collect() {
    std::vector<event> read;
    for (auto* const each : polled_) {
        if (!natsSubscription_IsValid(each)) { // it has been drained
            continue;
        }
        int left = 0; // to ask for one more would have the library describe an error
        int bytes = 0;
        natsMsg* message = nullptr;
        natsSubscription_GetPending(each, &left, &bytes);
        for (; left > 0 && natsSubscription_NextMsg(&message, each, 0) == NATS_OK; --left) {
            read.push_back(message_of(message));
        }
    }
    if (!read.empty()) {
        const std::lock_guard lock{mutex_};
        for (auto& each : read) {
            put_locked(std::move(each));
        }
    }
}

void nats_connection::send_rest() {
    const auto until = std::chrono::steady_clock::now() + flush_at_end;
    apply_commands();
    while (natsConnection_Buffered(connection_) > 0 && !closed_ && std::chrono::steady_clock::now() < until) {
        pollfd waited{.fd = socket_, .events = POLLOUT, .revents = 0};
        constexpr int step = 20; // milliseconds
        if (::poll(&waited, 1, step) > 0) {
            natsConnection_ProcessWriteEvent(connection_);
        }
    }
}

void nats_connection::disconnect() {
    for (const auto& [subject, subscription] : std::exchange(subscriptions_, {})) {
        natsSubscription_Destroy(subscription);
    }
    for (auto* const each : std::exchange(draining_, {})) {
        natsSubscription_Destroy(each);
    }
    polled_.clear();
    natsConnection_Destroy(std::exchange(connection_, nullptr));
    const std::lock_guard lock{mutex_};
    commands_.clear();
    queued_ = 0;
    buffered_ = 0;
}

} // namespace cles::nats
