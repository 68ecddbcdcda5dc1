// SPDX-License-Identifier: BSL-1.0
// NNG: REQ asks REP by asynchronous operations, a context for each call in flight, as its manual recommends for servers
// and clients under load; PUB and SUB for the fan-out. Its TCP transport sets TCP_NODELAY unless told otherwise.
#include "driver/ordered_fan_out.hpp"
#include "driver/packets.hpp"
#include "driver/peer.hpp"

#include <nng/nng.h>
#include <nng/protocol/pubsub0/pub.h>
#include <nng/protocol/pubsub0/sub.h>
#include <nng/protocol/reqrep0/rep.h>
#include <nng/protocol/reqrep0/req.h>

#include <condition_variable>
#include <mutex>
#include <span>
#include <stdexcept>
#include <vector>

#include <unistd.h>

namespace cles::perf::peers {
namespace {

constexpr std::size_t served_at_once = 128;

void require(int code, const char* attempted) {
    if (code != 0) {
        throw std::runtime_error(std::string{"NNG, "} + attempted + ": " + ::nng_strerror(code));
    }
}

class socket {
  public:
    template <class Open>
    explicit socket(Open* open) {
        require(open(&socket_), "opening a socket");
    }
    socket(const socket&) = delete;
    socket& operator=(const socket&) = delete;
    ~socket() { ::nng_close(socket_); }
    [[nodiscard]] nng_socket get() const noexcept { return socket_; }

    /// The address at which it listens, with the port that the system chose.
    std::string listen(const std::string& where) {
        nng_listener listener{};
        require(::nng_listen(socket_, where.c_str(), &listener, 0), "listening");
        if (!where.starts_with("tcp:")) {
            return where;
        }
        int port = 0;
        require(::nng_listener_get_int(listener, NNG_OPT_TCP_BOUND_PORT, &port), "the port");
        return "tcp://127.0.0.1:" + std::to_string(port);
    }
    void dial(const std::string& where) { require(::nng_dial(socket_, where.c_str(), nullptr, 0), "dialling"); }

  private:
    nng_socket socket_{};
};

/// An asynchronous operation that calls a member function when it is done.
template <class Owner, void (Owner::*Done)()>
class operation {
  public:
    explicit operation(Owner* owner) {
        require(::nng_aio_alloc(
                    &aio_, [](void* of) { (static_cast<Owner*>(of)->*Done)(); }, owner),
                "an operation");
    }
    operation(const operation&) = delete;
    operation& operator=(const operation&) = delete;
    ~operation() { ::nng_aio_free(aio_); } // waits for its function
    [[nodiscard]] nng_aio* get() const noexcept { return aio_; }

  private:
    nng_aio* aio_ = nullptr;
};

nng_msg* message_of(std::span<const std::byte> bytes) {
    nng_msg* made = nullptr;
    require(::nng_msg_alloc(&made, 0), "a message");
    require(::nng_msg_append(made, bytes.data(), bytes.size()), "a message");
    return made;
}

std::span<const std::byte> bytes_of(nng_msg* message) {
    return {static_cast<const std::byte*>(::nng_msg_body(message)), ::nng_msg_len(message)};
}

/// One of the requests that are served at a time. Functions of different ones may run at once.
class served {
  public:
    explicit served(nng_socket at) {
        require(::nng_ctx_open(&context_, at), "a context");
        ::nng_ctx_recv(context_, waiting_.get());
    }
    served(const served&) = delete;
    served& operator=(const served&) = delete;
    ~served() { ::nng_ctx_close(context_); }

  private:
    void next() {
        if (::nng_aio_result(waiting_.get()) != 0) {
            return; // closed
        }
        // Before the next operation starts, which may complete at once on another thread.
        is_answering_ = !is_answering_;
        if (!is_answering_) {
            ::nng_ctx_recv(context_, waiting_.get());
            return;
        }
        auto* const message = ::nng_aio_get_msg(waiting_.get());
        const auto answer = node_.answer(bytes_of(message));
        ::nng_msg_clear(message);
        require(::nng_msg_append(message, answer.data(), answer.size()), "an answer");
        ::nng_aio_set_msg(waiting_.get(), message);
        ::nng_ctx_send(context_, waiting_.get());
    }

    nng_ctx context_{};
    answering node_;
    bool is_answering_ = false;
    operation<served, &served::next> waiting_{this};
};

/// What the lanes of a run have in common.
class run_of_calls {
  public:
    run_of_calls(call what, std::size_t lanes, latency_recorder& record)
        : what_(what), record_(record), to_ask_(record.remaining()), lanes_(lanes) {}

    /// Whether a lane has to send another request; otherwise it has ended.
    bool next() {
        const std::lock_guard lock{guard_};
        if (to_ask_ > 0 && failure_.empty()) {
            --to_ask_;
            return true;
        }
        if (--lanes_ == 0) {
            over_.notify_one();
        }
        return false;
    }
    void answered(std::span<const std::byte> answer, std::chrono::steady_clock::time_point began) {
        check_answer(what_, answer);
        const auto took = std::chrono::steady_clock::now() - began;
        const std::lock_guard lock{guard_};
        record_.record(took);
    }
    void fail(const std::string& why) {
        const std::lock_guard lock{guard_};
        failure_ = why;
    }
    void wait() {
        std::unique_lock lock{guard_};
        over_.wait(lock, [this] { return lanes_ == 0; });
        if (!failure_.empty()) {
            throw std::runtime_error("NNG: " + failure_);
        }
    }
    [[nodiscard]] call what() const noexcept { return what_; }

  private:
    call what_;
    latency_recorder& record_;
    std::mutex guard_;
    std::condition_variable over_;
    std::size_t to_ask_;
    std::size_t lanes_;
    std::string failure_;
};

class lane {
  public:
    lane(nng_socket at, run_of_calls& run) : run_(run) { require(::nng_ctx_open(&context_, at), "a context"); }
    lane(const lane&) = delete;
    lane& operator=(const lane&) = delete;
    ~lane() { ::nng_ctx_close(context_); }

    void ask() {
        if (!run_.next()) {
            return;
        }
        began_ = std::chrono::steady_clock::now();
        sent_ = false;
        ::nng_aio_set_msg(waiting_.get(), message_of(request_of(run_.what())));
        ::nng_ctx_send(context_, waiting_.get());
    }

  private:
    void next() {
        try {
            require(::nng_aio_result(waiting_.get()), "a call");
            if (!sent_) {
                sent_ = true;
                ::nng_ctx_recv(context_, waiting_.get());
                return;
            }
            auto* const message = ::nng_aio_get_msg(waiting_.get());
            run_.answered(bytes_of(message), began_);
            ::nng_msg_free(message);
        } catch (const std::exception& failure) {
            run_.fail(failure.what());
        }
        ask();
    }

    run_of_calls& run_;
    nng_ctx context_{};
    bool sent_ = false;
    std::chrono::steady_clock::time_point began_;
    operation<lane, &lane::next> waiting_{this};
};

class nng_caller final : public caller {
  public:
    nng_caller(call what, const std::string& where) : what_(what) { socket_.dial(where); }

    void ask(std::size_t in_flight, latency_recorder& record) override {
        run_of_calls run{what_, in_flight, record};
        std::vector<std::unique_ptr<lane>> lanes;
        for (std::size_t i = 0; i < in_flight; ++i) {
            lanes.push_back(std::make_unique<lane>(socket_.get(), run));
        }
        for (auto& each : lanes) {
            each->ask();
        }
        run.wait();
    }

  private:
    call what_;
    socket socket_{::nng_req0_open};
};

class subscription {
  public:
    subscription(const std::string& where, std::size_t number, inbox& into) : number_(number), into_(into) {
        require(::nng_socket_set(socket_.get(), NNG_OPT_SUB_SUBSCRIBE, "", 0), "subscribing");
        socket_.dial(where);
        ::nng_recv_aio(socket_.get(), waiting_.get());
    }
    subscription(const subscription&) = delete;
    subscription& operator=(const subscription&) = delete;
    ~subscription() { ::nng_aio_stop(waiting_.get()); }

  private:
    void next() {
        if (::nng_aio_result(waiting_.get()) != 0) {
            return; // closed
        }
        auto* const message = ::nng_aio_get_msg(waiting_.get());
        try {
            into_.take(number_, read_update(bytes_of(message)));
        } catch (...) {
            into_.fail(std::current_exception());
        }
        ::nng_msg_free(message);
        ::nng_recv_aio(socket_.get(), waiting_.get());
    }

    std::size_t number_;
    inbox& into_;
    socket socket_{::nng_sub0_open};
    operation<subscription, &subscription::next> waiting_{this};
};

class nng_subscriptions final : public subscriptions {
  public:
    nng_subscriptions(const std::string& where, std::size_t count, inbox& into) {
        for (std::size_t i = 0; i < count; ++i) {
            all_.push_back(std::make_unique<subscription>(where, i, into));
        }
    }

  private:
    std::vector<std::unique_ptr<subscription>> all_;
};

class nng final : public peer {
  public:
    explicit nng(std::string_view carrier)
        : listen_(carrier == "unix" ? "abstract://cles-peers-nng-" + std::to_string(::getpid()) : "tcp://127.0.0.1:0") {
    }

    void serve(call, const announce& tell) override {
        socket at{::nng_rep0_open};
        std::vector<std::unique_ptr<served>> all;
        for (std::size_t i = 0; i < served_at_once; ++i) {
            all.push_back(std::make_unique<served>(at.get()));
        }
        tell(at.listen(listen_));
        for (;;) {
            ::pause();
        }
    }

    std::unique_ptr<caller> call_at(call what, const std::string& where) override {
        return std::make_unique<nng_caller>(what, where);
    }

    void publish(const announce& tell) override {
        socket at{::nng_pub0_open};
        publish_by_order(at.listen(listen_), tell, [&](const publication& value) {
            require(::nng_sendmsg(at.get(), message_of(icd::pack_update(1, value)), 0), "publishing");
        });
    }

    std::unique_ptr<fan_out> subscribe(const std::string& where, std::size_t count) override {
        return std::make_unique<ordered_fan_out>(where, count, [count](const std::string& at, inbox& into) {
            return std::make_unique<nng_subscriptions>(at, count, into);
        });
    }

  private:
    std::string listen_;
};

} // namespace

const description about{
    .name = "nng",
    .carriers = "tcp unix",
    .settings = "asynchronous REQ to 128 contexts of REP, PUB to SUB, the packets of the hand-written exchange",
};

std::string version() { return ::nng_version(); }

std::unique_ptr<peer> make_peer(std::string_view carrier) { return std::make_unique<nng>(carrier); }

} // namespace cles::perf::peers
