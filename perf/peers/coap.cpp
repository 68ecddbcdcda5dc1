// SPDX-License-Identifier: BSL-1.0
// CoAP, by libcoap over UDP: confirmable requests, whose answers come with the acknowledgement, one datagram each way;
// as many at once as are wanted (NSTART). The fan-out is a resource that each subscriber observes from a session of its
// own, always notified without confirmation, which a node may do for a day.
#include "broker.hpp"
#include "driver/ordered_fan_out.hpp"
#include "driver/packets.hpp"
#include "driver/peer.hpp"

#include <coap3/coap.h>

#include <algorithm>
#include <cstring>
#include <exception>
#include <span>
#include <stdexcept>
#include <vector>

#include <arpa/inet.h>
#include <sys/socket.h>

namespace cles::perf::peers {
namespace {

constexpr int most_attempts = 10;

void require(bool is_good, const char* attempted) {
    if (!is_good) {
        throw std::runtime_error(std::string{"CoAP: "} + attempted + " failed");
    }
}

coap_address_t loopback(std::uint16_t port) {
    coap_address_t made;
    ::coap_address_init(&made);
    made.size = sizeof made.addr.sin;
    made.addr.sin.sin_family = AF_INET;
    made.addr.sin.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    made.addr.sin.sin_port = htons(port);
    return made;
}

class context {
  public:
    context() {
        ::coap_startup();
        ::coap_set_log_level(LOG_ERR);
        self_ = ::coap_new_context(nullptr);
        require(self_ != nullptr, "a context");
    }
    context(const context&) = delete;
    context& operator=(const context&) = delete;
    ~context() {
        ::coap_free_context(self_);
        ::coap_cleanup();
    }
    [[nodiscard]] coap_context_t* get() const noexcept { return self_; }

    /// libcoap does not report the port that the system chose, so a port is chosen here.
    std::uint16_t listen() {
        for (int attempt = 0; attempt < most_attempts; ++attempt) {
            const auto port = free_port(SOCK_DGRAM);
            const auto at = loopback(port);
            if (::coap_new_endpoint(self_, &at, COAP_PROTO_UDP) != nullptr) {
                return port;
            }
        }
        throw std::runtime_error("CoAP: cannot find a free port");
    }
    coap_session_t* call(std::uint16_t port) {
        const auto at = loopback(port);
        auto* const made = ::coap_new_client_session(self_, nullptr, &at, COAP_PROTO_UDP);
        require(made != nullptr, "a session");
        return made;
    }
    /// Waits no longer than this, and processes what has arrived.
    void turn(std::uint32_t milliseconds) { require(::coap_io_process(self_, milliseconds) >= 0, "the loop"); }
    /// Processes what has arrived.
    void turn_once() { turn(COAP_IO_NO_WAIT); }

    coap_resource_t* add(const char* path, coap_request_t method, coap_method_handler_t handler, void* of) {
        auto* const made = ::coap_resource_init(::coap_make_str_const(path), COAP_RESOURCE_FLAGS_NOTIFY_NON_ALWAYS);
        ::coap_register_request_handler(made, method, handler);
        ::coap_resource_set_userdata(made, of);
        ::coap_add_resource(self_, made);
        return made;
    }

  private:
    coap_context_t* self_ = nullptr;
};

const char* path_of(call what) { return what == call::exchange ? "localization" : "empty"; }

void answer_with(coap_pdu_t* response, std::span<const std::byte> bytes) {
    ::coap_pdu_set_code(response, COAP_RESPONSE_CODE_CONTENT);
    ::coap_add_data(response, bytes.size(), reinterpret_cast<const std::uint8_t*>(bytes.data()));
}

std::span<const std::byte> bytes_of(const coap_pdu_t* message) {
    std::size_t length = 0;
    const std::uint8_t* data = nullptr;
    ::coap_get_data(message, &length, &data);
    return {reinterpret_cast<const std::byte*>(data), length};
}

/// A request for a path, with a token that the answer repeats.
coap_pdu_t* request_for(coap_session_t* session, coap_request_t method, const char* path, std::uint64_t token,
                        bool observe = false) {
    auto* const made = ::coap_pdu_init(COAP_MESSAGE_CON, static_cast<coap_pdu_code_t>(method),
                                       ::coap_new_message_id(session), ::coap_session_max_pdu_size(session));
    require(made != nullptr, "a request");
    std::uint8_t bytes[sizeof token];
    std::memcpy(bytes, &token, sizeof token);
    ::coap_add_token(made, sizeof bytes, bytes);
    if (observe) {
        ::coap_add_option(made, COAP_OPTION_OBSERVE, 0, nullptr);
    }
    ::coap_add_option(made, COAP_OPTION_URI_PATH, std::strlen(path), reinterpret_cast<const std::uint8_t*>(path));
    return made;
}

std::uint64_t token_of(const coap_pdu_t* message) {
    std::uint64_t token = 0;
    const auto bytes = ::coap_pdu_get_token(message);
    std::memcpy(&token, bytes.s, std::min(bytes.length, sizeof token));
    return token;
}

class coap_caller final : public caller {
  public:
    coap_caller(call what, std::uint16_t port) : what_(what), session_(at_.call(port)) {
        ::coap_session_set_app_data(session_, this);
        ::coap_register_response_handler(
            at_.get(), [](coap_session_t* session, const coap_pdu_t*, const coap_pdu_t* received, const coap_mid_t) {
                static_cast<coap_caller*>(::coap_session_get_app_data(session))->take(received);
                return COAP_RESPONSE_OK;
            });
    }
    coap_caller(const coap_caller&) = delete;
    coap_caller& operator=(const coap_caller&) = delete;
    ~coap_caller() override { ::coap_session_release(session_); }

    void ask(std::size_t in_flight, latency_recorder& record) override {
        ::coap_session_set_nstart(session_, static_cast<std::uint16_t>(in_flight + 1));
        record_ = &record;
        asked_.assign(in_flight, {});
        to_ask_ = record.remaining();
        for (std::size_t place = 0; place < in_flight && to_ask_ > 0; ++place) {
            send(place);
        }
        while (!record.full()) {
            at_.turn(1000);
            if (failure_) {
                std::rethrow_exception(failure_);
            }
        }
    }

  private:
    using clock = std::chrono::steady_clock;

    struct request {
        std::uint64_t token = 0; ///< of the pending request; 0: none
        clock::time_point began;
    };

    void take(const coap_pdu_t* received) {
        try {
            const auto token = token_of(received);
            const auto place = token % asked_.size();
            auto& asked = asked_[place];
            if (asked.token != token) {
                return; // already answered
            }
            check_answer(what_, bytes_of(received));
            record_->record(clock::now() - asked.began);
            asked.token = 0;
            if (to_ask_ > 0) {
                send(place);
            }
        } catch (...) {
            failure_ = std::current_exception(); // the library is in C
        }
    }

    /// The token identifies the slot, because answers may arrive in any order.
    void send(std::size_t place) {
        --to_ask_;
        const auto token = ++turn_ * asked_.size() + place;
        asked_[place] = {token, clock::now()};
        const bool is_pull = what_ == call::exchange;
        auto* const message =
            request_for(session_, is_pull ? COAP_REQUEST_GET : COAP_REQUEST_POST, path_of(what_), token);
        require(::coap_send(session_, message) != COAP_INVALID_MID, "sending");
    }

    call what_;
    context at_;
    coap_session_t* session_;
    latency_recorder* record_ = nullptr;
    std::vector<request> asked_; ///< a slot for each that may be in flight
    std::size_t to_ask_ = 0;
    std::uint64_t turn_ = 0;
    std::exception_ptr failure_;
};

class coap_subscriptions final : public subscriptions {
  public:
    coap_subscriptions(std::uint16_t port, std::size_t count, inbox& into) : into_(into) {
        ::coap_register_response_handler(
            at_.get(), [](coap_session_t* session, const coap_pdu_t*, const coap_pdu_t* received, const coap_mid_t) {
                static_cast<coap_subscriptions*>(::coap_session_get_app_data(session))->take(received);
                return COAP_RESPONSE_OK;
            });
        for (std::size_t i = 0; i < count; ++i) {
            sessions_.push_back(at_.call(port));
            ::coap_session_set_app_data(sessions_.back(), this);
            auto* const request = request_for(sessions_.back(), COAP_REQUEST_GET, path_of(call::exchange), i, true);
            require(::coap_send(sessions_.back(), request) != COAP_INVALID_MID, "observing");
        }
    }
    coap_subscriptions(const coap_subscriptions&) = delete;
    coap_subscriptions& operator=(const coap_subscriptions&) = delete;
    ~coap_subscriptions() override {
        for (auto* const each : sessions_) {
            ::coap_session_release(each);
        }
    }

    void take_for(std::chrono::milliseconds at_most, inbox& into) override {
        const auto end = std::chrono::steady_clock::now() + at_most;
        for (auto left = at_most; left.count() > 0 && !(into.look().complete && into.all_reached());
             left = std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now())) {
            at_.turn(static_cast<std::uint32_t>(left.count()));
        }
    }

  private:
    void take(const coap_pdu_t* received) {
        try {
            const auto packet = bytes_of(received);
            if (!packet.empty()) { // the answer before anything is published
                into_.take(token_of(received), read_update(packet));
            }
        } catch (...) {
            into_.fail(std::current_exception());
        }
    }

    inbox& into_;
    context at_;
    std::vector<coap_session_t*> sessions_;
};

class coap final : public peer {
  public:
    void serve(call what, const announce& tell) override {
        context at;
        answering node;
        if (what == call::exchange) {
            at.add(path_of(what), COAP_REQUEST_GET, &answer<call::exchange>, &node);
        } else {
            at.add(path_of(what), COAP_REQUEST_POST, &answer<call::task>, &node);
        }
        tell(std::to_string(at.listen()));
        for (;;) {
            at.turn(COAP_IO_WAIT);
        }
    }

    std::unique_ptr<caller> call_at(call what, const std::string& where) override {
        return std::make_unique<coap_caller>(what, port_of(where));
    }

    void publish(const announce& tell) override {
        context at;
        std::vector<std::byte> last;
        auto* const resource = at.add(path_of(call::exchange), COAP_REQUEST_GET, &show, &last);
        ::coap_resource_set_get_observable(resource, 1);
        publish_by_order(std::to_string(at.listen()), tell, [&](const publication& value) {
            at.turn_once(); // new subscribers
            const auto packet = icd::pack_update(1, value);
            last.assign(packet.begin(), packet.end());
            ::coap_resource_notify_observers(resource, nullptr);
            at.turn_once();
        });
    }

    std::unique_ptr<fan_out> subscribe(const std::string& where, std::size_t count) override {
        return std::make_unique<ordered_fan_out>(where, count, [count](const std::string& at, inbox& into) {
            return std::make_unique<coap_subscriptions>(port_of(at), count, into);
        });
    }

  private:
    static std::uint16_t port_of(const std::string& where) { return static_cast<std::uint16_t>(std::stoi(where)); }

    template <call What>
    static void answer(coap_resource_t* resource, coap_session_t*, const coap_pdu_t*, const coap_string_t*,
                       coap_pdu_t* response) {
        auto& node = *static_cast<answering*>(::coap_resource_get_userdata(resource));
        answer_with(response, node.answer(request_of(What)));
    }

    static void show(coap_resource_t* resource, coap_session_t*, const coap_pdu_t*, const coap_string_t*,
                     coap_pdu_t* response) {
        answer_with(response, *static_cast<std::vector<std::byte>*>(::coap_resource_get_userdata(resource)));
    }
};

} // namespace

const description about{
    .name = "coap",
    .carriers = "udp",
    .settings =
        "libcoap, confirmable requests answered with the acknowledgement, observed resources, the packets of the "
        "hand-written exchange",
};

std::string version() { return "libcoap " LIBCOAP_PACKAGE_VERSION; }

std::unique_ptr<peer> make_peer(std::string_view) { return std::make_unique<coap>(); }

} // namespace cles::perf::peers
