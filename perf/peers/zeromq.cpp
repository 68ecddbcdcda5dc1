// SPDX-License-Identifier: BSL-1.0
// ZeroMQ: a DEALER asks a ROUTER, which needs no empty frame between address and packet; PUB and SUB for the fan-out.
// libzmq sets TCP_NODELAY itself. One I/O thread on each side, which is the default of a context.
#include "driver/ordered_fan_out.hpp"
#include "driver/packets.hpp"
#include "driver/peer.hpp"

#include <zmq.hpp>

#include <array>
#include <span>
#include <vector>

#include <unistd.h>

namespace cles::perf::peers {
namespace {

std::span<const std::byte> bytes_of(const zmq::message_t& message) {
    return {message.data<std::byte>(), message.size()};
}

template <class Bytes>
zmq::const_buffer buffer_of(const Bytes& bytes) {
    return zmq::buffer(bytes.data(), bytes.size());
}

class zeromq_caller final : public caller {
  public:
    zeromq_caller(call what, const std::string& where) : what_(what), request_(request_of(what)) {
        socket_.set(zmq::sockopt::linger, 0);
        socket_.connect(where);
    }

    void ask(std::size_t in_flight, latency_recorder& record) override {
        // Answers of one server arrive in the order of the requests.
        std::vector<clock::time_point> began(in_flight);
        auto to_ask = record.remaining();
        for (std::size_t i = 0; i < in_flight && to_ask > 0; ++i, --to_ask) {
            began[i] = clock::now();
            (void)socket_.send(buffer_of(request_), zmq::send_flags::none);
        }
        for (std::size_t i = 0; !record.full(); i = (i + 1) % in_flight) {
            (void)socket_.recv(answer_, zmq::recv_flags::none);
            check_answer(what_, bytes_of(answer_));
            const auto now = clock::now();
            record.record(now - began[i]);
            if (to_ask > 0) {
                --to_ask;
                began[i] = now;
                (void)socket_.send(buffer_of(request_), zmq::send_flags::none);
            }
        }
    }

  private:
    using clock = std::chrono::steady_clock;

    call what_;
    icd::request_bytes request_;
    zmq::context_t context_{1};
    zmq::socket_t socket_{context_, zmq::socket_type::dealer};
    zmq::message_t answer_;
};

/// One thread waits for all of the sockets.
class zeromq_subscriptions final : public subscriptions {
  public:
    zeromq_subscriptions(const std::string& where, std::size_t count) {
        for (std::size_t i = 0; i < count; ++i) {
            sockets_.emplace_back(context_, zmq::socket_type::sub);
            sockets_.back().set(zmq::sockopt::subscribe, "");
            sockets_.back().connect(where);
        }
        for (auto& each : sockets_) {
            items_.push_back({each.handle(), 0, ZMQ_POLLIN, 0});
        }
    }

    void take_for(std::chrono::milliseconds at_most, inbox& into) override {
        const auto end = std::chrono::steady_clock::now() + at_most;
        for (auto left = at_most; left.count() > 0 && !is_all_here(into);
             left = std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now())) {
            if (zmq::poll(items_, left) == 0) {
                return;
            }
            for (std::size_t i = 0; i < items_.size(); ++i) {
                while ((items_[i].revents & ZMQ_POLLIN) != 0 && sockets_[i].recv(message_, zmq::recv_flags::dontwait)) {
                    into.take(i, read_update(bytes_of(message_)));
                }
            }
        }
    }

  private:
    static bool is_all_here(inbox& into) { return into.look().complete && into.all_reached(); }

    zmq::context_t context_{1};
    std::vector<zmq::socket_t> sockets_;
    std::vector<zmq::pollitem_t> items_;
    zmq::message_t message_;
};

class zeromq final : public peer {
  public:
    explicit zeromq(std::string_view carrier)
        : listen_(carrier == "unix" ? "ipc://@cles-peers-zeromq-" + std::to_string(::getpid()) : "tcp://127.0.0.1:*") {}

    void serve(call, const announce& tell) override {
        zmq::context_t context{1};
        zmq::socket_t socket{context, zmq::socket_type::router};
        socket.bind(listen_);
        tell(socket.get(zmq::sockopt::last_endpoint));
        answering node;
        zmq::message_t who;
        zmq::message_t request;
        for (;;) {
            (void)socket.recv(who, zmq::recv_flags::none);
            (void)socket.recv(request, zmq::recv_flags::none);
            (void)socket.send(who, zmq::send_flags::sndmore);
            (void)socket.send(buffer_of(node.answer(bytes_of(request))), zmq::send_flags::none);
        }
    }

    std::unique_ptr<caller> call_at(call what, const std::string& where) override {
        return std::make_unique<zeromq_caller>(what, where);
    }

    void publish(const announce& tell) override {
        zmq::context_t context{1};
        zmq::socket_t socket{context, zmq::socket_type::pub};
        socket.set(zmq::sockopt::linger, 0);
        socket.bind(listen_);
        publish_by_order(socket.get(zmq::sockopt::last_endpoint), tell, [&](const publication& value) {
            (void)socket.send(buffer_of(icd::pack_update(1, value)), zmq::send_flags::none);
        });
    }

    std::unique_ptr<fan_out> subscribe(const std::string& where, std::size_t count) override {
        return std::make_unique<ordered_fan_out>(where, count, [count](const std::string& at, inbox&) {
            return std::make_unique<zeromq_subscriptions>(at, count);
        });
    }

  private:
    std::string listen_;
};

} // namespace

const description about{
    .name = "zeromq",
    .carriers = "tcp unix",
    .settings = "DEALER to ROUTER, PUB to SUB, one I/O thread each, the packets of the hand-written exchange",
};

std::string version() {
    const auto [major, minor, patch] = zmq::version();
    return std::to_string(major) + '.' + std::to_string(minor) + '.' + std::to_string(patch);
}

std::unique_ptr<peer> make_peer(std::string_view carrier) { return std::make_unique<zeromq>(carrier); }

} // namespace cles::perf::peers
