// SPDX-License-Identifier: BSL-1.0
// Redis, by hiredis: a store between the two ends. The localization is what the node has SET, and GET fetches it from
// the store without asking the node. A task is pushed to a list, which the node waits for (BLPOP), as work queues on
// Redis do; clients that push turn off its replies. The fan-out is PUBLISH and SUBSCRIBE.
#include "broker.hpp"
#include "driver/ordered_fan_out.hpp"
#include "driver/packets.hpp"
#include "driver/peer.hpp"
#include "driver/polled_subscriptions.hpp"

#include <hiredis/hiredis.h>

#include <span>
#include <stdexcept>
#include <thread>
#include <vector>

#include <sys/socket.h>

namespace cles::perf::peers {
namespace {

constexpr std::chrono::milliseconds between_attempts{10};
constexpr int most_attempts = 1000;

using reply_ptr = std::unique_ptr<redisReply, decltype(&::freeReplyObject)>;

std::span<const std::byte> bytes_of(const redisReply& text) {
    return {reinterpret_cast<const std::byte*>(text.str), text.len};
}

class connection {
  public:
    explicit connection(const std::string& where) : self_(connected(where)) {}
    connection(const connection&) = delete;
    connection& operator=(const connection&) = delete;
    ~connection() { ::redisFree(self_); }

    /// `with` replaces "%b".
    void put(const char* command, std::span<const std::byte> with) {
        require(::redisAppendCommand(self_, command, with.data(), with.size()));
    }
    void put(const char* command) { require(::redisAppendCommand(self_, command)); }
    void flush() {
        for (int done = 0; done == 0;) {
            require(::redisBufferWrite(self_, &done));
        }
    }
    /// Sends what is buffered, and waits for a reply.
    reply_ptr get() {
        void* reply = nullptr;
        require(::redisGetReply(self_, &reply));
        return owned(reply);
    }
    /// A reply that has been read; empty if there is no more.
    reply_ptr next_read() {
        void* reply = nullptr;
        require(::redisGetReplyFromReader(self_, &reply));
        return owned(reply);
    }
    void read() { require(::redisBufferRead(self_)); }
    [[nodiscard]] int socket() const noexcept { return self_->fd; }
    /// Turns off replies.
    void want_no_replies() {
        put("CLIENT REPLY OFF");
        flush();
    }

  private:
    static redisContext* connected(const std::string& where) {
        for (int attempt = 0;; ++attempt) {
            auto* const made = where.starts_with('/') ? ::redisConnectUnix(where.c_str())
                                                      : ::redisConnect("127.0.0.1", std::stoi(where));
            if (made != nullptr && made->err == 0) {
                return made;
            }
            if (made != nullptr) {
                ::redisFree(made);
            }
            if (attempt == most_attempts) {
                throw std::runtime_error("Redis: the store does not answer");
            }
            std::this_thread::sleep_for(between_attempts); // it may still be starting
        }
    }
    void require(int code) const {
        if (code != REDIS_OK) {
            throw std::runtime_error(std::string{"Redis: "} + self_->errstr);
        }
    }
    reply_ptr owned(void* reply) const {
        reply_ptr made{static_cast<redisReply*>(reply), &::freeReplyObject};
        if (made && made->type == REDIS_REPLY_ERROR) {
            throw std::runtime_error("Redis: " + std::string{made->str, made->len});
        }
        return made;
    }

    redisContext* self_;
};

class redis_caller final : public caller {
  public:
    redis_caller(call what, const std::string& where)
        : what_(what), request_(request_of(what)), asking_(where), waiting_(where) {
        if (what_ == call::task) {
            asking_.want_no_replies();
        }
    }

    void ask(std::size_t in_flight, latency_recorder& record) override {
        // Answers arrive in the order of the requests.
        std::vector<clock::time_point> began(in_flight);
        auto to_ask = record.remaining();
        for (std::size_t i = 0; i < in_flight && to_ask > 0; ++i, --to_ask) {
            began[i] = clock::now();
            send();
        }
        for (std::size_t i = 0; !record.full(); i = (i + 1) % in_flight) {
            take();
            const auto now = clock::now();
            record.record(now - began[i]);
            if (to_ask > 0) {
                --to_ask;
                began[i] = now;
                send();
            }
        }
    }

  private:
    using clock = std::chrono::steady_clock;

    void send() {
        if (what_ == call::exchange) {
            waiting_.put("GET localization");
            waiting_.flush();
        } else {
            asking_.put("RPUSH jobs %b", request_);
            asking_.flush();
            waiting_.put("BLPOP answers 0");
            waiting_.flush();
        }
    }
    void take() {
        const auto reply = waiting_.get();
        const bool is_list = reply->type == REDIS_REPLY_ARRAY && reply->elements == 2;
        check_answer(what_, bytes_of(is_list ? *reply->element[1] : *reply));
    }

    call what_;
    icd::request_bytes request_;
    connection asking_;
    connection waiting_;
};

class redis_subscriptions final : public polled_subscriptions {
  public:
    redis_subscriptions(const std::string& where, std::size_t count) {
        for (std::size_t i = 0; i < count; ++i) {
            all_.push_back(std::make_unique<connection>(where));
            all_.back()->put("SUBSCRIBE localization");
            (void)all_.back()->get();
            wait_for_socket(all_.back()->socket());
        }
    }

  private:
    void read(std::size_t number, inbox& into) override {
        all_[number]->read();
        while (const auto message = all_[number]->next_read()) {
            if (message->type == REDIS_REPLY_ARRAY && message->elements == 3) {
                into.take(number, read_update(bytes_of(*message->element[2])));
            }
        }
    }

    std::vector<std::unique_ptr<connection>> all_;
};

class redis final : public peer {
  public:
    explicit redis(std::string_view carrier)
        : is_unix_(carrier == "unix"), port_(is_unix_ ? 0 : free_port(SOCK_STREAM)),
          store_([this](const std::filesystem::path& folder) {
              return std::vector<std::string>{"/usr/bin/redis-server",
                                              "--port",
                                              std::to_string(port_),
                                              "--bind",
                                              "127.0.0.1",
                                              "--unixsocket",
                                              folder / "redis.sock",
                                              "--dir",
                                              folder,
                                              "--save",
                                              "",
                                              "--appendonly",
                                              "no"};
          }),
          where_(is_unix_ ? (store_.folder() / "redis.sock").string() : std::to_string(port_)) {}

    void serve(call what, const announce& tell) override {
        connection waiting{where_};
        connection answering_to{where_};
        answering node;
        if (what == call::exchange) {
            waiting.put("SET localization %b", node.answer(request_of(call::exchange)));
            (void)waiting.get();
        } else {
            answering_to.want_no_replies();
        }
        tell(where_);
        while (what == call::exchange) {
            ::pause(); // the store answers
        }
        for (;;) {
            waiting.put("BLPOP jobs 0");
            const auto job = waiting.get();
            answering_to.put("RPUSH answers %b", node.answer(bytes_of(*job->element[1])));
            answering_to.flush();
        }
    }

    std::unique_ptr<caller> call_at(call what, const std::string& where) override {
        return std::make_unique<redis_caller>(what, where);
    }

    void publish(const announce& tell) override {
        connection store{where_};
        store.want_no_replies();
        publish_by_order(where_, tell, [&](const publication& value) {
            store.put("PUBLISH localization %b", icd::pack_update(1, value));
            store.flush();
        });
    }

    std::unique_ptr<fan_out> subscribe(const std::string& where, std::size_t count) override {
        return std::make_unique<ordered_fan_out>(where, count, [count](const std::string& at, inbox&) {
            return std::make_unique<redis_subscriptions>(at, count);
        });
    }

    [[nodiscard]] pid_t broker() const override { return store_.id(); }

  private:
    bool is_unix_;
    std::uint16_t port_;
    peers::broker store_;
    std::string where_;
};

} // namespace

const description about{
    .name = "redis",
    .carriers = "unix tcp",
    .settings =
        "GET of what the node has SET, tasks through lists, PUBLISH; no persistence, no replies to clients that push",
};

std::string version() {
    return "hiredis " + std::to_string(HIREDIS_MAJOR) + '.' + std::to_string(HIREDIS_MINOR) + '.' +
           std::to_string(HIREDIS_PATCH) + ", " + first_line_of("/usr/bin/redis-server --version");
}

std::unique_ptr<peer> make_peer(std::string_view carrier) { return std::make_unique<redis>(carrier); }

} // namespace cles::perf::peers
