// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/relay.hpp"

#include <cles/convert.hpp>
#include <cles/service.hpp>

#include "platoon/drive/vehicle_networks.hpp"
#include "platoon/simulation/link_matrix.hpp"
#include "platoon/simulation/simulation.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>

namespace platoon {

namespace asio = boost::asio;
using steady = std::chrono::steady_clock;

namespace {

using packet = std::vector<unsigned char>;

constexpr std::size_t header_size = 20; // of IPv4, without options
constexpr std::size_t largest_packet = 65536;
constexpr std::size_t at_protocol = 9, at_destination = 16;
constexpr unsigned char icmp = 1, tcp = 6, udp = 17;

class packet_relay {
  public:
    explicit packet_relay(const relay_options& how)
        : links_(how.losses, how.delay, how.seed), timer_(io_), signals_(io_, SIGTERM, SIGINT),
          service_(io_, options_of(how)) {
        for (const int each : how.devices) {
            devices_.push_back({.stream = asio::posix::stream_descriptor{io_, each}});
        }
        service_.on_pull("links", [this] { return counted(); },
                         {.description = "What each link has carried", .parameters = {}, .idempotent = true});
        signals_.async_wait([this](boost::system::error_code, int) {
            service_.stop();
            io_.stop();
        });
    }

    void run() {
        for (std::size_t i = 0; i < devices_.size(); ++i) {
            read(i);
        }
        io_.run();
    }

  private:
    struct device {
        asio::posix::stream_descriptor stream;
        packet buffer = packet(largest_packet);
    };
    struct delayed {
        std::size_t to = 0;
        std::shared_ptr<const packet> what{};
    };

    static cles::service_options options_of(const relay_options& how) {
        cles::service_options out;
        out.name = relay_name;
        out.listen = {how.listen};
        return out;
    }

    [[nodiscard]] relay_count counted() const {
        relay_count all;
        for (std::size_t from = 0; from < devices_.size(); ++from) {
            for (std::size_t to = 0; to < devices_.size(); ++to) {
                const auto one = links_.counted(from, to);
                all.delivered += one.delivered;
                all.lost += one.lost;
                if (one.delivered + one.lost != 0) {
                    all.links.push_back(
                        {.from = name_of(from), .to = name_of(to), .delivered = one.delivered, .lost = one.lost});
                }
            }
        }
        all.delivered -= std::min(overflown_, all.delivered);
        all.overflown = overflown_;
        return all;
    }

    void read(std::size_t from) {
        auto& here = devices_[from];
        here.stream.async_read_some(asio::buffer(here.buffer),
                                    [this, from](boost::system::error_code failed, std::size_t size) {
                                        if (failed) {
                                            return; // the drive has ended
                                        }
                                        carry(from, std::span{devices_[from].buffer}.first(size));
                                        read(from);
                                    });
    }

    void carry(std::size_t from, std::span<const unsigned char> what) {
        constexpr unsigned char first_of_group = 224;
        constexpr unsigned char last_of_group = 239;
        constexpr unsigned char version_4 = 4;
        const bool carried = what.size() >= header_size && what[0] >> 4U == version_4 &&
                             (what[at_protocol] == udp || what[at_protocol] == tcp || what[at_protocol] == icmp);
        if (!carried) { // what the system sends by itself, such as IGMP
            return;
        }
        const auto shared = std::make_shared<const packet>(what.begin(), what.end());
        const bool to_all = what[at_destination] >= first_of_group && what[at_destination] <= last_of_group;
        for (std::size_t to = 0; to < devices_.size(); ++to) {
            if (to != from && (to_all || what[at_destination + 3] == host_number(to))) {
                send(from, to, shared);
            }
        }
    }

    void send(std::size_t from, std::size_t to, const std::shared_ptr<const packet>& what) {
        const auto later = links_.next(from, to);
        if (!later) {
            return;
        }
        if (*later == 0) {
            deliver({.to = to, .what = what});
            return;
        }
        const auto due =
            steady::now() + std::chrono::duration_cast<steady::duration>(std::chrono::duration<double>{*later});
        const bool is_first = waiting_.empty() || due < waiting_.begin()->first;
        waiting_.emplace(due, delayed{.to = to, .what = what});
        if (is_first) {
            wait();
        }
    }

    void wait() {
        timer_.expires_at(waiting_.begin()->first);
        timer_.async_wait([this](boost::system::error_code cancelled) {
            if (cancelled) {
                return;
            }
            while (!waiting_.empty() && waiting_.begin()->first <= steady::now()) {
                deliver(waiting_.begin()->second);
                waiting_.erase(waiting_.begin());
            }
            if (!waiting_.empty()) {
                wait();
            }
        });
    }

    void deliver(const delayed& one) {
        boost::system::error_code failed;
        devices_[one.to].stream.write_some(asio::buffer(*one.what), failed);
        overflown_ += failed ? 1U : 0U;
    }

    asio::io_context io_{1};
    link_matrix links_;
    asio::steady_timer timer_;
    asio::signal_set signals_;
    cles::service service_;
    std::vector<device> devices_;
    std::multimap<steady::time_point, delayed> waiting_;
    std::uint64_t overflown_ = 0;
};

} // namespace

void run_relay(const relay_options& options) { packet_relay{options}.run(); }

} // namespace platoon
