// SPDX-License-Identifier: BSL-1.0
// NATS by its C library and its server. A request is a message to the node's subject, its answer one to the asker's;
// the server is between them both times. The thread that publishes a message also sends it, without the library's
// flusher.
#include "broker.hpp"
#include "driver/ordered_fan_out.hpp"
#include "driver/packets.hpp"
#include "driver/peer.hpp"

#include <nats/nats.h>

#include <condition_variable>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include <sys/socket.h>

namespace cles::perf::peers {
namespace {

constexpr std::chrono::milliseconds between_attempts{10};
constexpr int most_attempts = 1000;
constexpr std::int64_t patience_ms = 10'000;
const char* const requests = "car1.localization.request";
const char* const answers = "bench.localization.answer";
const char* const updates = "car1.localization";

void require(natsStatus code, const char* attempted) {
    if (code != NATS_OK) {
        throw std::runtime_error(std::string{"NATS, "} + attempted + ": " + ::natsStatus_GetText(code));
    }
}

/// A connection to the server.
class client {
  public:
    using handler = std::function<void(std::span<const std::byte> message, const char* reply_to)>;

    /// \param shares_thread all such connections of this process receive their messages on one thread
    explicit client(int port, bool shares_thread = false) {
        natsOptions* made = nullptr;
        require(::natsOptions_Create(&made), "options");
        const std::unique_ptr<natsOptions, decltype(&::natsOptions_Destroy)> options{made, &::natsOptions_Destroy};
        require(::natsOptions_SetURL(options.get(), ("nats://127.0.0.1:" + std::to_string(port)).c_str()), "address");
        require(::natsOptions_SetSendAsap(options.get(), true), "sending at once");
        require(::natsOptions_UseGlobalMessageDelivery(options.get(), shares_thread), "threads");
        auto code = ::natsConnection_Connect(&self_, options.get());
        for (int attempt = 1; code != NATS_OK && attempt < most_attempts; ++attempt) {
            std::this_thread::sleep_for(between_attempts); // the server has just been started
            code = ::natsConnection_Connect(&self_, options.get());
        }
        require(code, "connecting");
    }
    client(const client&) = delete;
    client& operator=(const client&) = delete;
    ~client() {
        ::natsSubscription_Destroy(subscription_);
        ::natsConnection_Destroy(self_);
    }

    /// `on_message` is called on a thread of the library, and may not throw. The server has the subscription when this
    /// returns.
    void subscribe(const char* subject, handler on_message) {
        on_message_ = std::move(on_message);
        require(::natsConnection_Subscribe(&subscription_, self_, subject, &client::hand_over, this), "subscribing");
        require(::natsConnection_FlushTimeout(self_, patience_ms), "subscribing");
    }
    void publish(const char* subject, std::span<const std::byte> bytes) {
        require(::natsConnection_Publish(self_, subject, bytes.data(), static_cast<int>(bytes.size())), "publishing");
    }
    void request(std::span<const std::byte> bytes) {
        require(::natsConnection_PublishRequest(self_, requests, answers, bytes.data(), static_cast<int>(bytes.size())),
                "asking");
    }

  private:
    static void hand_over(natsConnection*, natsSubscription*, natsMsg* message, void* of) {
        const std::span<const char> bytes{::natsMsg_GetData(message),
                                          static_cast<std::size_t>(::natsMsg_GetDataLength(message))};
        static_cast<client*>(of)->on_message_(std::as_bytes(bytes), ::natsMsg_GetReply(message));
        ::natsMsg_Destroy(message);
    }

    natsConnection* self_ = nullptr;
    natsSubscription* subscription_ = nullptr;
    handler on_message_;
};

/// What a thread of the library must not throw.
class first_failure {
  public:
    template <class Function>
    void watch(Function&& function) noexcept {
        try {
            function();
        } catch (...) {
            const std::lock_guard lock{guard_};
            failure_ = std::current_exception();
            news_.notify_one();
        }
    }
    /// Returns only by throwing it.
    void wait() {
        std::unique_lock lock{guard_};
        news_.wait(lock, [this] { return failure_ != nullptr; });
        std::rethrow_exception(failure_);
    }

  private:
    std::mutex guard_;
    std::condition_variable news_;
    std::exception_ptr failure_;
};

class nats_caller final : public caller {
  public:
    nats_caller(call what, int port) : what_(what), request_(request_of(what)), bus_(port) {
        bus_.subscribe(answers, [this](std::span<const std::byte> answer, const char*) { take(answer); });
    }

    void ask(std::size_t in_flight, latency_recorder& record) override {
        std::unique_lock lock{guard_};
        record_ = &record;
        began_.assign(in_flight, {});
        to_ask_ = record.remaining();
        at_ = 0;
        for (std::size_t i = 0; i < in_flight && to_ask_ > 0; ++i) {
            next(i);
        }
        ended_.wait(lock, [this] { return record_->full() || failure_ != nullptr; });
        if (failure_) {
            std::rethrow_exception(failure_);
        }
    }

  private:
    using clock = std::chrono::steady_clock;

    // On one connection, answers arrive in the order of the requests.
    void take(std::span<const std::byte> answer) {
        const std::lock_guard lock{guard_};
        try {
            check_answer(what_, answer);
            record_->record(clock::now() - began_[at_]);
            if (to_ask_ > 0) {
                next(at_);
            }
            at_ = (at_ + 1) % began_.size();
        } catch (...) {
            failure_ = std::current_exception();
        }
        if (record_->full() || failure_) {
            ended_.notify_one();
        }
    }
    void next(std::size_t place) {
        --to_ask_;
        began_[place] = clock::now();
        bus_.request(request_);
    }

    call what_;
    icd::request_bytes request_;
    std::mutex guard_; // of all that follows, which the library's thread uses too
    std::condition_variable ended_;
    latency_recorder* record_ = nullptr;
    std::vector<clock::time_point> began_;
    std::size_t to_ask_ = 0;
    std::size_t at_ = 0;
    std::exception_ptr failure_;
    client bus_;
};

class nats_subscriptions final : public subscriptions {
  public:
    nats_subscriptions(int port, std::size_t count, inbox& into) {
        for (std::size_t i = 0; i < count; ++i) {
            all_.push_back(std::make_unique<client>(port, true));
            all_.back()->subscribe(updates, [i, &into](std::span<const std::byte> packet, const char*) {
                try {
                    into.take(i, read_update(packet));
                } catch (...) {
                    into.fail(std::current_exception());
                }
            });
        }
    }

  private:
    std::vector<std::unique_ptr<client>> all_;
};

class nats final : public peer {
  public:
    nats()
        : port_(free_port(SOCK_STREAM)), between_([this](const std::filesystem::path&) {
              return std::vector<std::string>{server, "-a", "127.0.0.1", "-p", std::to_string(port_)};
          }) {}

    static constexpr const char* server = "/usr/sbin/nats-server";

    void serve(call, const announce& tell) override {
        first_failure failed;
        answering node;
        client bus{port_};
        bus.subscribe(requests, [&](std::span<const std::byte> request, const char* reply_to) {
            failed.watch([&] { bus.publish(reply_to, node.answer(request)); });
        });
        tell("ready");
        failed.wait();
    }

    std::unique_ptr<caller> call_at(call what, const std::string&) override {
        return std::make_unique<nats_caller>(what, port_);
    }

    void publish(const announce& tell) override {
        client bus{port_};
        publish_by_order("server", tell,
                         [&](const publication& value) { bus.publish(updates, icd::pack_update(1, value)); });
    }

    std::unique_ptr<fan_out> subscribe(const std::string& where, std::size_t count) override {
        return std::make_unique<ordered_fan_out>(where, count, [this, count](const std::string&, inbox& into) {
            return std::make_unique<nats_subscriptions>(port_, count, into);
        });
    }

    [[nodiscard]] pid_t broker() const override { return between_.id(); }

  private:
    int port_;
    peers::broker between_;
};

} // namespace

const description about{
    .name = "nats",
    .carriers = "tcp",
    .settings = "libnats and nats-server, messages are sent by the thread that publishes them, the packets of the "
                "hand-written exchange",
};

std::string version() {
    return std::string{"libnats "} + ::nats_GetVersion() + ", " +
           first_line_of(nats::server + std::string{" --version"});
}

std::unique_ptr<peer> make_peer(std::string_view) { return std::make_unique<nats>(); }

} // namespace cles::perf::peers
