// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/unordered/unordered_flat_map.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace cles::runtime {

struct requester_queue;

/// The jobs that wait for a worker, served round-robin: requesters take turns, and the jobs of one requester keep their
/// order. So a requester with a thousand jobs makes another wait for one of them, not for all.
///
/// Items are linked in place: in steady state nothing is allocated.
class job_queue {
  public:
    /// Something that can be queued. The queue borrows it until it is popped or removed.
    class item {
      public:
        item() = default;
        item(const item&) = delete;
        item& operator=(const item&) = delete;

        /// Any number that identifies the requester.
        std::uint64_t requester = 0;
        [[nodiscard]] bool queued() const noexcept { return queue_ != nullptr; }

      protected:
        ~item() = default;

      private:
        friend job_queue;
        requester_queue* queue_ = nullptr;
        item* previous_ = nullptr;
        item* next_in_queue_ = nullptr;
    };

    explicit job_queue(std::size_t capacity);
    job_queue(const job_queue&) = delete;
    job_queue& operator=(const job_queue&) = delete;
    ~job_queue();

    /// Queues a new job. False if the queue is full.
    [[nodiscard]] bool push(item& job);
    /// Queues a job that has started and continues: before the new jobs of its requester, and without a limit, because
    /// it has been admitted, and others may wait for it.
    void push_resumed(item& job);
    /// The next job; null if there is none.
    item* pop() noexcept;
    /// Removes a job if it is queued.
    void remove(item& job) noexcept;

    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    [[nodiscard]] bool empty() const noexcept { return size_ == 0; }

  private:
    requester_queue* queue_of(std::uint64_t requester);
    void unlink(item& job) noexcept;
    void forget_idle();

    std::size_t capacity_;
    std::size_t size_ = 0;
    boost::unordered_flat_map<std::uint64_t, std::unique_ptr<requester_queue>> requesters_;
    std::vector<std::unique_ptr<requester_queue>> spare_;
    requester_queue* next_ = nullptr; // in the ring of requesters with jobs
    std::size_t idle_ = 0;            // requesters without jobs
};

} // namespace cles::runtime
