// SPDX-License-Identifier: BSL-1.0
// gRPC: unary calls to an asynchronous server with one completion queue and one thread. One call at a time blocks; many
// wait on a completion queue. All go through one channel. The fan-out is a stream to each subscriber, by the callback
// API on both sides, each subscriber with a channel and a connection of its own. The transport sets TCP_NODELAY itself.
#include "grpc.hpp"

#include "driver/ordered_fan_out.hpp"
#include "driver/peer.hpp"

#include <unistd.h>

namespace cles::perf::peers {
namespace {

class grpc_peer final : public peer {
  public:
    explicit grpc_peer(std::string_view carrier)
        : listen_(carrier == "unix" ? "unix-abstract:cles-peers-grpc-" + std::to_string(::getpid()) : "127.0.0.1:0") {}

    void serve(call what, const announce& tell) override { serve_calls(what, listen_, tell); }

    std::unique_ptr<caller> call_at(call what, const std::string& where) override {
        return make_grpc_caller(what, where);
    }

    void publish(const announce& tell) override {
        grpc_publisher car{listen_};
        publish_by_order(car.where(), tell, [&](const publication& value) { car.publish(value); });
    }

    std::unique_ptr<fan_out> subscribe(const std::string& where, std::size_t count) override {
        return std::make_unique<ordered_fan_out>(where, count, [count](const std::string& at, inbox& into) {
            return make_grpc_subscriptions(at, count, into);
        });
    }

  private:
    std::string listen_;
};

} // namespace

const description about{
    .name = "grpc",
    .carriers = "tcp unix",
    .settings =
        "unary calls on one channel, asynchronous server with one completion queue; streams by the callback API; both "
        "ends on all cores, because it is several times slower if its threads share one",
    .on_all_cores = true,
};

std::string version() { return ::grpc::Version(); }

std::unique_ptr<peer> make_peer(std::string_view carrier) { return std::make_unique<grpc_peer>(carrier); }

} // namespace cles::perf::peers
