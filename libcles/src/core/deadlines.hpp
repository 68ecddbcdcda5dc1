// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

namespace cles::core {

class deadline_queue;

/// Something that is to happen at a point in time, unless it is disarmed or destroyed before.
class deadline {
  public:
    deadline() = default;
    deadline(const deadline&) = delete;
    deadline& operator=(const deadline&) = delete;

    [[nodiscard]] bool armed() const noexcept { return queue_ != nullptr; }
    [[nodiscard]] time_point due() const noexcept { return due_; }

  protected:
    ~deadline();

  private:
    friend deadline_queue;
    virtual void on_deadline(time_point now) = 0;

    deadline_queue* queue_ = nullptr;
    std::size_t place_ = 0;
    time_point due_{};
};

/// All deadlines of a service, the next one first: a binary heap of borrowed entries, so that one timer serves them
/// all. Deadlines that come in order, as those of equal timeouts do, are added in constant time.
class deadline_queue {
  public:
    deadline_queue() = default;
    deadline_queue(const deadline_queue&) = delete;
    deadline_queue& operator=(const deadline_queue&) = delete;
    ~deadline_queue();

    /// Arms it anew where it is armed already.
    void arm(deadline& d, time_point due);
    void disarm(deadline& d) noexcept;
    [[nodiscard]] std::optional<time_point> next() const noexcept;
    /// Runs what is due. What is armed meanwhile for `now` or before runs too.
    void expire(time_point now);
    [[nodiscard]] std::size_t size() const noexcept { return heap_.size(); }

  private:
    void place(deadline& d, std::size_t at) noexcept;
    void rise(std::size_t at) noexcept;
    void sink(std::size_t at) noexcept;

    std::vector<deadline*> heap_;
};

} // namespace cles::core
