// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

namespace cles::core {

/// How many bytes a node may hold for its peers, and how many it holds.
class memory_budget {
  public:
    explicit memory_budget(std::size_t limit) noexcept : limit_(limit) {}
    memory_budget(const memory_budget&) = delete;
    memory_budget& operator=(const memory_budget&) = delete;

    [[nodiscard]] std::size_t limit() const noexcept { return limit_; }
    [[nodiscard]] std::size_t used() const noexcept { return used_; }
    [[nodiscard]] std::size_t free() const noexcept { return used_ < limit_ ? limit_ - used_ : 0; }
    /// How often a reservation was refused.
    [[nodiscard]] std::uint64_t refusals() const noexcept { return refusals_; }

  private:
    friend class memory_account;

    std::size_t limit_;
    std::size_t used_ = 0;
    std::uint64_t refusals_ = 0;
};

/// The memory held for one link, or by one part of the node.
///
/// No account holds more than is free: a single one gets half of the total, two get a third each, and so on, and
/// something is left for the next one. If many hold much, those that hold most are refused first. What the node keeps
/// for all (last values) may take half, whatever links hold, as long as memory is free, so that no peer displaces it.
class memory_account {
  public:
    enum class share : std::uint8_t { fair, half };

    explicit memory_account(memory_budget& of, share which = share::fair) noexcept : of_(of), share_(which) {}
    memory_account(const memory_account&) = delete;
    memory_account& operator=(const memory_account&) = delete;

    [[nodiscard]] std::size_t used() const noexcept { return used_; }
    /// Whether it may hold this many more bytes.
    [[nodiscard]] bool has_capacity(std::size_t more) const noexcept {
        const auto free = of_.free();
        if (more > free) {
            return false;
        }
        // A fair share is no more than what is free afterwards.
        const auto most = share_ == share::half ? std::max(of_.limit_ / 2, more) : free - more;
        return more <= most && used_ <= most - more;
    }

  private:
    friend class memory_reservation;

    void grow(std::size_t by) noexcept {
        used_ += by;
        of_.used_ += by;
    }
    void shrink(std::size_t by) noexcept {
        used_ -= by;
        of_.used_ -= by;
    }
    bool refuse() noexcept {
        ++of_.refusals_;
        return false;
    }

    memory_budget& of_; // lives as long as any memory is held
    share share_;
    std::size_t used_ = 0;
};

/// Bytes that are held for its lifetime. Without an account, they count against nothing.
class memory_reservation {
  public:
    memory_reservation() = default;
    explicit memory_reservation(std::shared_ptr<memory_account> whose) noexcept : whose_(std::move(whose)) {}
    memory_reservation(memory_reservation&& other) noexcept
        : whose_(std::move(other.whose_)), bytes_(std::exchange(other.bytes_, 0)) {}
    memory_reservation& operator=(memory_reservation&& other) noexcept {
        std::swap(whose_, other.whose_);
        std::swap(bytes_, other.bytes_);
        return *this;
    }
    memory_reservation(const memory_reservation&) = delete;
    memory_reservation& operator=(const memory_reservation&) = delete;
    ~memory_reservation() { resize(0); }

    [[nodiscard]] std::size_t size() const noexcept { return bytes_; }
    [[nodiscard]] const std::shared_ptr<memory_account>& account() const noexcept { return whose_; }
    /// Changes the number of bytes held. Shrinking always succeeds; growth that exceeds the limit changes nothing and
    /// the result is false.
    [[nodiscard]] bool try_resize(std::size_t bytes) noexcept {
        if (whose_ && bytes > bytes_ && !whose_->has_capacity(bytes - bytes_)) {
            return whose_->refuse();
        }
        resize(bytes);
        return true;
    }
    /// The same regardless of the limit, for memory that is in use already.
    void resize(std::size_t bytes) noexcept {
        if (bytes == bytes_) {
            return;
        }
        if (whose_ && bytes > bytes_) {
            whose_->grow(bytes - bytes_);
        } else if (whose_) {
            whose_->shrink(bytes_ - bytes);
        }
        bytes_ = bytes;
    }

  private:
    std::shared_ptr<memory_account> whose_;
    std::size_t bytes_ = 0;
};

} // namespace cles::core
