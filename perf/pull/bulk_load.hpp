// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include <cstddef>
#include <string>

/// Large answers of a node, so many in flight that it always has one to send.
namespace cles::perf {

inline constexpr std::size_t bulk_bytes = 100'000;

/// Registers the PULL of `bulk_bytes`.
void register_bulk(cles::registrar& tasks);

/// Keeps PULLs of them in flight. \pre when it is destroyed, none is in flight, or the client's context no longer runs
class bulk_load {
  public:
    /// \pre the client can reach `node`
    bulk_load(cles::service& client, const std::string& node) : client_(client), noun_(node + ":bulk") {}

    void start(std::size_t in_flight);
    /// Starts no more; those in flight are still answered.
    void stop() noexcept { over_ = true; }
    [[nodiscard]] std::size_t in_flight() const noexcept { return in_flight_; }

  private:
    void ask();

    cles::service& client_;
    std::string noun_;
    std::size_t in_flight_ = 0;
    bool over_ = true;
};

} // namespace cles::perf
