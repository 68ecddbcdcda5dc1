// SPDX-License-Identifier: BSL-1.0
#include "security/keys/secret.hpp"

#include <algorithm>
#include <array>
#include <bitset>
#include <map>
#include <mutex>
#include <new>
#include <stdexcept>

#include <sodium.h>

namespace cles::security {

void prepare_sodium() {
    static const bool ready = sodium_init() >= 0;
    if (!ready) {
        throw std::runtime_error{"the system provides no random numbers"};
    }
}

namespace {

// Small secrets share locked pages, since the system limits how much a process may lock, and a node has several keys
// for each session. Larger ones have pages of their own.
class secret_pool {
  public:
    static constexpr std::size_t cell_size = 64;

    std::uint8_t* take() {
        const std::lock_guard guard{mutex_};
        for (auto& [start, cells_of] : blocks_) {
            if (!cells_of.used.all()) {
                return cells_of.take(start);
            }
        }
        auto* const start = static_cast<std::uint8_t*>(sodium_malloc(cell_size * cells));
        if (start == nullptr) {
            throw std::bad_alloc{};
        }
        try {
            return blocks_[start].take(start);
        } catch (...) {
            sodium_free(start);
            throw;
        }
    }

    void give_back(std::uint8_t* cell) noexcept {
        const std::lock_guard guard{mutex_};
        const auto found = std::prev(blocks_.upper_bound(cell));
        auto& [start, cells_of] = *found;
        cells_of.used.reset(static_cast<std::size_t>(cell - start) / cell_size);
        if (cells_of.used.none() && blocks_.size() > 1) {
            sodium_free(start);
            blocks_.erase(found);
        }
    }

  private:
    // With the canary that libsodium adds, one page of 4 KiB.
    static constexpr std::size_t cells = 63;

    struct block {
        std::bitset<cells> used{};

        std::uint8_t* take(std::uint8_t* start) noexcept {
            std::size_t at = 0;
            while (used.test(at)) {
                ++at;
            }
            used.set(at);
            return start + at * cell_size;
        }
    };

    std::mutex mutex_;
    std::map<std::uint8_t*, block> blocks_;
};

// Never destroyed, because secrets in static objects outlive it otherwise.
secret_pool& pool() {
    alignas(secret_pool) static std::array<std::byte, sizeof(secret_pool)> memory;
    static auto* const made = new (memory.data()) secret_pool;
    return *made;
}

std::uint8_t* allocate(std::size_t size) {
    prepare_sodium();
    if (size <= secret_pool::cell_size) {
        return pool().take();
    }
    auto* const bytes = static_cast<std::uint8_t*>(sodium_malloc(size));
    if (bytes == nullptr) {
        throw std::bad_alloc{};
    }
    return bytes;
}

} // namespace

void wipe_secret::operator()(std::uint8_t* bytes) const noexcept {
    if (size <= secret_pool::cell_size) {
        sodium_memzero(bytes, size);
        pool().give_back(bytes);
    } else {
        sodium_free(bytes); // wipes it, too
    }
}

secret_bytes::secret_bytes(std::size_t size) {
    if (size != 0) {
        bytes_ = std::unique_ptr<std::uint8_t[], wipe_secret>{allocate(size), wipe_secret{size}};
        std::fill_n(data(), size, std::uint8_t{0});
    }
}

secret_bytes::secret_bytes(bytes_view from) : secret_bytes(from.size()) { std::copy(from.begin(), from.end(), data()); }

secret_bytes secret_bytes::random(std::size_t size) {
    secret_bytes made{size};
    if (size != 0) {
        randombytes_buf(made.data(), size);
    }
    return made;
}

} // namespace cles::security
