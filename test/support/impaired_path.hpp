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

/// The impairments of a path, applied to each direction separately.
struct impairment {
    double loss = 0;  ///< share of all datagrams that never arrive
    double twice = 0; ///< share of the others that arrive twice
    /// Each is delayed by a time between these, so that datagrams that are close together may be reordered.
    std::chrono::milliseconds least_delay{0};
    std::chrono::milliseconds most_delay{0};
};

/// A network between clients and a node's UDP port that impairs datagrams, always in the same way for one seed.
///
/// It listens on a free port of loopback; the node sees each client as a separate source.
class impaired_path {
  public:
    impaired_path(boost::asio::io_context& io, std::string_view node, impairment how, std::uint32_t seed);
    ~impaired_path();
    impaired_path(const impaired_path&) = delete;
    impaired_path& operator=(const impaired_path&) = delete;

    /// The URL to which clients send.
    [[nodiscard]] std::string url() const;
    /// From now on.
    void set(impairment how);
    /// `drop` is called with every datagram before anything happens to it; true drops it.
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
