// SPDX-License-Identifier: BSL-1.0
// CLES itself: PULL, DELEGATE and UPDATE as a user writes them, in processes that sleep while they wait.
#include <cles/run.hpp>
#include <cles/service.hpp>
#include <cles/version.hpp>

#include "driver/peer.hpp"
#include "perf/fan_out/fan_out_exchange.hpp"
#include "perf/jobs/delegate_load.hpp"
#include "perf/pull/pull_exchange.hpp"
#include "perf/support/multicast_socket.hpp"

#include <boost/asio/io_context.hpp>

#include <optional>
#include <utility>
#include <vector>

#include <unistd.h>

namespace cles::perf::peers {
namespace {

class pulls final : public caller {
  public:
    explicit pulls(const std::string& where)
        : client_(io_, {.name = "bench", .peers = {{"car1", where}}}),
          load_(io_, client_, "car1:localization", handler_style::callback, true) {}

    void ask(std::size_t in_flight, latency_recorder& record) override {
        (void)load_.run(in_flight, std::chrono::nanoseconds::max(), record);
    }

  private:
    boost::asio::io_context io_{1};
    cles::service client_;
    pull_load load_;
};

class delegates final : public caller {
  public:
    explicit delegates(const std::string& where)
        : client_(io_, {.name = "bench", .peers = {{"car1", where}}}), load_(io_, client_, "car1:empty", {}) {}

    void ask(std::size_t in_flight, latency_recorder& record) override { (void)load_.run(in_flight, record); }

  private:
    boost::asio::io_context io_{1};
    cles::service client_;
    delegate_load load_;
};

class feeds final : public fan_out {
  public:
    /// Each feed has a service of its own, because feeds of one service would share a link.
    feeds(const std::string& where, const multicast_options& multicast, std::size_t count)
        : binding_{.style = handler_style::callback, .multicast = multicast.is_on()} {
        for (std::size_t i = 0; i < count; ++i) {
            cles::service_options options{
                .name = "bench" + std::to_string(i), .peers = {{"car1", where}}, .multicast = multicast};
            services_.push_back(std::make_unique<cles::service>(io_, std::move(options)));
            clients_.push_back(services_.back().get());
        }
    }

    fan_out_tally run(const fan_out_order& order, latency_recorder* record) override {
        return take_fan_out(io_, clients_, order, binding_, record);
    }

  private:
    boost::asio::io_context io_{1};
    fan_out_binding binding_;
    std::vector<std::unique_ptr<cles::service>> services_;
    std::vector<cles::service*> clients_;
};

class cles_peer final : public peer {
  public:
    explicit cles_peer(std::string_view carrier)
        : listen_(carrier == "unix"  ? "unix://@cles-peers-" + std::to_string(::getpid())
                  : carrier == "udp" ? "udp://127.0.0.1:0"
                                     : "tcp://127.0.0.1:0") {
        if (carrier == "multicast") {
            const auto& group = port_.emplace().get();
            multicast_ = {.interface = "lo", .group = group.address, .port = group.port};
        }
    }

    void serve(call what, const announce& tell) override {
        if (multicast_.is_on()) {
            throw not_offered("requests to one node use a link, not multicast");
        }
        if (what == call::exchange) {
            serve_localization(listen_, {}, tell);
            return;
        }
        boost::asio::io_context io{1};
        cles::service car{io, {.name = "car1", .listen = {listen_}}};
        car.on_delegate("empty", [] {});
        tell(car.endpoints().front());
        cles::run(io);
    }

    std::unique_ptr<caller> call_at(call what, const std::string& where) override {
        if (what == call::exchange) {
            return std::make_unique<pulls>(where);
        }
        return std::make_unique<delegates>(where);
    }

    void publish(const announce& tell) override {
        serve_fan_out({.name = "car1", .listen = {listen_}, .multicast = multicast_}, {}, tell);
    }

    std::unique_ptr<fan_out> subscribe(const std::string& where, std::size_t count) override {
        return std::make_unique<feeds>(where, multicast_, count);
    }

  private:
    std::string listen_;
    std::optional<reserved_group> port_;
    multicast_options multicast_;
};

} // namespace

const description about{
    .name = "cles",
    .carriers = "tcp unix udp multicast",
    .settings =
        "plain handlers, callbacks, typed values, no busy polling; the task is a handler of the node's own loop",
};

std::string version() { return std::string{cles::version}; }

std::unique_ptr<peer> make_peer(std::string_view carrier) { return std::make_unique<cles_peer>(carrier); }

} // namespace cles::perf::peers
