// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/keys/bytes.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

namespace cles::security {

/// Prepares libsodium, once for the process. Whatever calls libsodium without a secret or a key calls this first.
/// \throws std::runtime_error if the system has no random numbers
void prepare_sodium();

/// Wipes and frees the memory of a secret of this size.
struct wipe_secret {
    std::size_t size = 0;
    void operator()(std::uint8_t* bytes) const noexcept;
};

/// Secret bytes. Their memory is locked, so that it is not written to swap space, left out of core dumps, and wiped
/// when they are destroyed. If the system's limit of locked memory is reached, they are still left out and wiped.
///
/// Move only; a moved-from secret is empty. May be destroyed on any thread.
class secret_bytes {
  public:
    secret_bytes() = default;
    /// Zeros.
    explicit secret_bytes(std::size_t size);
    explicit secret_bytes(bytes_view from);
    /// From the operating system's generator.
    static secret_bytes random(std::size_t size);

    [[nodiscard]] std::uint8_t* data() noexcept { return bytes_.get(); }
    [[nodiscard]] const std::uint8_t* data() const noexcept { return bytes_.get(); }
    [[nodiscard]] std::size_t size() const noexcept { return bytes_ ? bytes_.get_deleter().size : 0; }
    [[nodiscard]] bytes_view view() const noexcept { return {data(), size()}; }
    [[nodiscard]] std::span<std::uint8_t> span() noexcept { return {data(), size()}; }
    [[nodiscard]] secret_bytes copy() const { return secret_bytes{view()}; }

  private:
    std::unique_ptr<std::uint8_t[], wipe_secret> bytes_;
};

} // namespace cles::security
