// SPDX-License-Identifier: BSL-1.0
// MQTT by mosquitto's client library and broker: quality of service 0, TCP_NODELAY at the clients and the broker. A
// request is a message to the node's topic, its answer one to the asker's; the broker is between them both times.
#include "broker.hpp"
#include "driver/ordered_fan_out.hpp"
#include "driver/packets.hpp"
#include "driver/peer.hpp"
#include "driver/polled_subscriptions.hpp"

#include <exception>
#include <fstream>
#include <functional>
#include <span>
#include <stdexcept>
#include <thread>
#include <vector>

#include <mosquitto.h>
#include <sys/socket.h>

namespace cles::perf::peers {
namespace {

constexpr std::chrono::milliseconds between_attempts{10};
constexpr int most_attempts = 1000;
constexpr int keep_alive_s = 60;
const char* const requests = "car1/localization/request";
const char* const answers = "bench/localization/answer";
const char* const updates = "car1/localization";

void require(int code, const char* attempted) {
    if (code != MOSQ_ERR_SUCCESS) {
        throw std::runtime_error(std::string{"MQTT, "} + attempted + ": " + ::mosquitto_strerror(code));
    }
}

std::span<const std::byte> bytes_of(const mosquitto_message& message) {
    return {static_cast<const std::byte*>(message.payload), static_cast<std::size_t>(message.payloadlen)};
}

/// A connection to the broker. `on_message` is called on the thread that runs the loop.
class client {
  public:
    client() : self_(::mosquitto_new(nullptr, true, this)) {
        if (self_ == nullptr) {
            throw std::runtime_error("MQTT: cannot create a client");
        }
    }
    client(const client&) = delete;
    client& operator=(const client&) = delete;
    ~client() { ::mosquitto_destroy(self_); }

    std::function<void(std::span<const std::byte>)> on_message;

    /// Waits until the broker has accepted the subscription, if there is one.
    void connect(int port, const char* topic) {
        require(::mosquitto_int_option(self_, MOSQ_OPT_TCP_NODELAY, 1), "TCP_NODELAY");
        ::mosquitto_connect_callback_set(
            self_, [](mosquitto*, void* of, int code) { static_cast<client*>(of)->is_ready_ = code == 0; });
        ::mosquitto_subscribe_callback_set(
            self_, [](mosquitto*, void* of, int, int, const int*) { static_cast<client*>(of)->is_ready_ = true; });
        ::mosquitto_message_callback_set(self_, [](mosquitto*, void* of, const mosquitto_message* message) {
            static_cast<client*>(of)->hand_over(bytes_of(*message));
        });
        for (int attempt = 0; ::mosquitto_connect(self_, "127.0.0.1", port, keep_alive_s) != MOSQ_ERR_SUCCESS;) {
            if (++attempt == most_attempts) {
                throw std::runtime_error("MQTT: the broker does not answer");
            }
            std::this_thread::sleep_for(between_attempts); // the broker has just been started
        }
        turn_until_ready();
        if (topic != nullptr) {
            require(::mosquitto_subscribe(self_, nullptr, topic, 0), "subscribing");
            turn_until_ready();
        }
    }

    void publish(const char* topic, std::span<const std::byte> bytes) {
        require(::mosquitto_publish(self_, nullptr, topic, static_cast<int>(bytes.size()), bytes.data(), 0, false),
                "publishing");
    }

    void turn(std::chrono::milliseconds at_most) {
        require(::mosquitto_loop(self_, static_cast<int>(at_most.count()), 1), "the loop");
        throw_failure();
    }
    /// \pre its socket is readable
    void read() {
        require(::mosquitto_loop_read(self_, 1), "reading");
        require(::mosquitto_loop_misc(self_), "keeping the connection");
        throw_failure();
    }
    [[nodiscard]] int socket() const { return ::mosquitto_socket(self_); }

  private:
    // Exceptions must not pass through the library, which is written in C.
    void hand_over(std::span<const std::byte> bytes) {
        try {
            on_message(bytes);
        } catch (...) {
            failure_ = std::current_exception();
        }
    }

    void throw_failure() const {
        if (failure_) {
            std::rethrow_exception(failure_);
        }
    }

    void turn_until_ready() {
        is_ready_ = false;
        for (int attempt = 0; !is_ready_; ++attempt) {
            if (attempt == most_attempts) {
                throw std::runtime_error("MQTT: the broker does not accept requests");
            }
            turn(between_attempts);
        }
    }

    mosquitto* self_;
    bool is_ready_ = false;
    std::exception_ptr failure_;
};

class mqtt_caller final : public caller {
  public:
    mqtt_caller(call what, int port) : what_(what), request_(request_of(what)) {
        bus_.on_message = [this](std::span<const std::byte> answer) { take(answer); };
        bus_.connect(port, answers);
    }

    void ask(std::size_t in_flight, latency_recorder& record) override {
        record_ = &record;
        began_.assign(in_flight, {});
        to_ask_ = record.remaining();
        at_ = 0;
        for (std::size_t i = 0; i < in_flight && to_ask_ > 0; ++i) {
            next(i);
        }
        while (!record.full()) {
            bus_.turn(std::chrono::seconds{10});
        }
    }

  private:
    using clock = std::chrono::steady_clock;

    // On one connection, answers arrive in the order of the requests.
    void take(std::span<const std::byte> answer) {
        check_answer(what_, answer);
        record_->record(clock::now() - began_[at_]);
        if (to_ask_ > 0) {
            next(at_);
        }
        at_ = (at_ + 1) % began_.size();
    }
    void next(std::size_t place) {
        --to_ask_;
        began_[place] = clock::now();
        bus_.publish(requests, request_);
    }

    call what_;
    icd::request_bytes request_;
    latency_recorder* record_ = nullptr;
    std::vector<clock::time_point> began_;
    std::size_t to_ask_ = 0;
    std::size_t at_ = 0;
    client bus_;
};

class mqtt_subscriptions final : public polled_subscriptions {
  public:
    mqtt_subscriptions(int port, std::size_t count, inbox& into) {
        for (std::size_t i = 0; i < count; ++i) {
            all_.push_back(std::make_unique<client>());
            all_.back()->on_message = [i, &into](std::span<const std::byte> packet) {
                into.take(i, read_update(packet));
            };
            all_.back()->connect(port, updates);
            wait_for_socket(all_.back()->socket());
        }
    }

  private:
    void read(std::size_t number, inbox&) override { all_[number]->read(); } // which calls on_message

    std::vector<std::unique_ptr<client>> all_;
};

class mqtt final : public peer {
  public:
    mqtt()
        : port_(free_port(SOCK_STREAM)), between_([this](const std::filesystem::path& folder) {
              const auto settings = folder / "mosquitto.conf";
              std::ofstream{settings} << "listener " << port_ << " 127.0.0.1\nallow_anonymous true\nuser root\n"
                                      << "set_tcp_nodelay true\npersistence false\nlog_dest none\n";
              return std::vector<std::string>{"/usr/sbin/mosquitto", "-c", settings.string()};
          }) {}

    void serve(call, const announce& tell) override {
        client bus;
        answering node;
        bus.on_message = [&](std::span<const std::byte> request) { bus.publish(answers, node.answer(request)); };
        bus.connect(port_, requests);
        tell("ready");
        for (;;) {
            bus.turn(std::chrono::seconds{10});
        }
    }

    std::unique_ptr<caller> call_at(call what, const std::string&) override {
        return std::make_unique<mqtt_caller>(what, port_);
    }

    void publish(const announce& tell) override {
        client bus;
        bus.on_message = [](std::span<const std::byte>) {};
        bus.connect(port_, nullptr);
        publish_by_order("broker", tell,
                         [&](const publication& value) { bus.publish(updates, icd::pack_update(1, value)); });
    }

    std::unique_ptr<fan_out> subscribe(const std::string& where, std::size_t count) override {
        return std::make_unique<ordered_fan_out>(where, count, [this, count](const std::string&, inbox& into) {
            return std::make_unique<mqtt_subscriptions>(port_, count, into);
        });
    }

    [[nodiscard]] pid_t broker() const override { return between_.id(); }

  private:
    int port_;
    peers::broker between_;
};

} // namespace

const description about{
    .name = "mqtt",
    .carriers = "tcp",
    .settings =
        "mosquitto's library and broker, quality of service 0, TCP_NODELAY, the packets of the hand-written exchange",
};

std::string version() {
    int major = 0;
    int minor = 0;
    int patch = 0;
    ::mosquitto_lib_version(&major, &minor, &patch);
    return "libmosquitto " + std::to_string(major) + '.' + std::to_string(minor) + '.' + std::to_string(patch) + ", " +
           first_line_of("/usr/sbin/mosquitto -h");
}

std::unique_ptr<peer> make_peer(std::string_view) { return std::make_unique<mqtt>(); }

} // namespace cles::perf::peers
