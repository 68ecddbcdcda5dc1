// SPDX-License-Identifier: BSL-1.0
// The hand-written exchange, with which all others are compared: packed structs on blocking sockets.
#include "driver/packets.hpp"
#include "driver/peer.hpp"
#include "perf/baseline/binders.hpp"
#include "perf/baseline/exchange.hpp"
#include "perf/baseline/publisher.hpp"
#include "perf/support/bare_socket.hpp"

#include <array>
#include <optional>
#include <utility>
#include <vector>

namespace cles::perf::peers {
namespace {

/// `icd::server` does not have the task.
void serve_tasks(const listener& at) {
    const auto client = accept_from(at);
    answering node;
    icd::request_bytes request{};
    while (receive_all(client.get(), request)) {
        send_all(client.get(), node.answer(request));
    }
}

class hand_caller final : public caller {
  public:
    hand_caller(call what, const url& where)
        : what_(what), request_(request_of(what)),
          answer_(what == call::exchange ? sizeof(icd::reply_packet) : sizeof(icd::request_packet)),
          socket_(connect_to(where)) {}

    void ask(std::size_t in_flight, latency_recorder& record) override {
        if (in_flight == 1) {
            one_by_one(record, [this] {
                send_all(socket_.get(), request_);
                take_answer();
            });
            return;
        }
        // Answers come in the order of the requests.
        std::vector<clock::time_point> began(in_flight);
        auto to_ask = record.remaining();
        for (std::size_t i = 0; i < in_flight && to_ask > 0; ++i, --to_ask) {
            began[i] = clock::now();
            send_all(socket_.get(), request_);
        }
        for (std::size_t i = 0; !record.full(); i = (i + 1) % in_flight) {
            take_answer();
            const auto now = clock::now();
            record.record(now - began[i]);
            if (to_ask > 0) {
                --to_ask;
                began[i] = now;
                send_all(socket_.get(), request_);
            }
        }
    }

  private:
    using clock = std::chrono::steady_clock;

    void take_answer() {
        if (!receive_all(socket_.get(), answer_)) {
            throw std::runtime_error("the hand-written server closed the connection");
        }
        check_answer(what_, answer_);
    }

    call what_;
    icd::request_bytes request_;
    std::vector<std::byte> answer_;
    descriptor socket_;
};

class hand_fan_out final : public fan_out {
  public:
    hand_fan_out(const url& where, std::optional<multicast_group> group) : binders_(where, std::move(group)) {}
    fan_out_tally run(const fan_out_order& order, latency_recorder* record) override {
        return binders_.run(order, record);
    }

  private:
    icd::binders binders_;
};

class by_hand final : public peer {
  public:
    explicit by_hand(std::string_view carrier)
        : listen_(parse_url(carrier == "unix" ? "unix://@cles-peers-by-hand-" + std::to_string(::getpid())
                                              : "tcp://127.0.0.1:0")) {
        if (carrier == "multicast") {
            group_ = port_.emplace().get();
        }
    }

    void serve(call what, const announce& tell) override {
        refuse_multicast();
        if (what == call::exchange) {
            icd::server packets{listen_};
            tell(to_string(packets.where()));
            packets.run();
        }
        const auto at = listen_on(listen_);
        tell(to_string(at.where));
        serve_tasks(at);
    }

    std::unique_ptr<caller> call_at(call what, const std::string& where) override {
        return std::make_unique<hand_caller>(what, parse_url(where));
    }

    void publish(const announce& tell) override {
        icd::publisher packets{listen_, group_};
        tell(to_string(packets.where()));
        packets.run();
    }

    std::unique_ptr<fan_out> subscribe(const std::string& where, std::size_t) override {
        return std::make_unique<hand_fan_out>(parse_url(where), group_);
    }

  private:
    void refuse_multicast() const {
        if (group_) {
            throw not_offered("multicast is for publications only");
        }
    }

    url listen_;
    std::optional<reserved_group> port_;
    std::optional<multicast_group> group_;
};

} // namespace

const description about{
    .name = "by_hand",
    .carriers = "tcp unix multicast",
    .settings = "packed structs, blocking sockets, TCP_NODELAY; subscribers by epoll; by multicast recvmmsg",
};

std::string version() { return "this tree's"; }

std::unique_ptr<peer> make_peer(std::string_view carrier) { return std::make_unique<by_hand>(carrier); }

} // namespace cles::perf::peers
