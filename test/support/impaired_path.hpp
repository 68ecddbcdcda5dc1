// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/udp.hpp>

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <string_view>

namespace cles::test {

/// What happens to datagrams on their way, each way for itself.
struct impairment {
    double loss = 0;  ///< how many of all never arrive
    double twice = 0; ///< how many of the others arrive twice
    /// Each is delayed by something between these, so that those which are far apart enough overtake each other.
    std::chrono::milliseconds least_delay{0};
    std::chrono::milliseconds most_delay{0};
};

/// A network between clients and a node's UDP port that treats datagrams badly, always alike for one seed.
///
/// It listens on a free port of loopback; the node sees each client as a source of its own.
class impaired_path {
  public:
    impaired_path(boost::asio::io_context& io, std::string_view node, impairment how, std::uint32_t seed);
    ~impaired_path();
    impaired_path(const impaired_path&) = delete;
    impaired_path& operator=(const impaired_path&) = delete;

    /// Where clients send to.
    [[nodiscard]] std::string url() const;
    /// From now on.
    void set(impairment how);
    /// Told of every datagram that comes in, before anything happens to it. True: it is dropped.
    void filter(std::function<bool(std::string_view datagram, bool to_node)> drop);

    [[nodiscard]] std::uint64_t to_node() const;
    [[nodiscard]] std::uint64_t to_clients() const;
    [[nodiscard]] std::uint64_t lost() const;
    [[nodiscard]] std::uint64_t doubled() const;

  private:
    class inside;
    std::shared_ptr<inside> inside_;
};

} // namespace cles::test
