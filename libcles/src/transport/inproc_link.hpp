// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

namespace cles::transport {

/// Posts to an executor for objects that may outlive it.
///
/// Its owner shuts it before the executor's context is destroyed; after that, nothing is posted. Thread-safe.
class mailbox {
  public:
    explicit mailbox(boost::asio::any_io_executor executor) : executor_(std::move(executor)) {}

    /// Runs `action` on the executor, later; drops it if the mailbox is shut.
    template <class F>
    void post(F action) {
        const std::lock_guard lock{mutex_};
        if (executor_) {
            boost::asio::post(executor_, std::move(action));
        }
    }

    void shut() {
        const std::lock_guard lock{mutex_};
        executor_ = nullptr;
    }

  private:
    std::mutex mutex_;
    boost::asio::any_io_executor executor_;
};

/// One end of a link between two services of a process: what one flushes is passed to the other on its executor,
/// without a socket and without copying. The two may run on different threads; each end is used only on its own
/// executor.
class inproc_link final : public link, public std::enable_shared_from_this<inproc_link> {
  public:
    inproc_link(boost::asio::any_io_executor executor, std::string address, const limits& bounds);
    inproc_link(const inproc_link&) = delete;
    inproc_link& operator=(const inproc_link&) = delete;
    ~inproc_link() override;

    /// Connects two ends.
    static void join(const std::shared_ptr<inproc_link>& a, const std::shared_ptr<inproc_link>& b);

    void start(std::shared_ptr<link_events> owner) override;
    std::string& output() override { return output_; }
    void flush() override;
    [[nodiscard]] std::size_t unsent() const noexcept override { return output_.size() + on_its_way(); }
    [[nodiscard]] std::uint64_t sent() const noexcept override { return flushed_ - on_its_way(); }
    [[nodiscard]] std::uint64_t received() const noexcept override { return received_; }
    void pause(bool stop) override;
    void finish() override;
    void close() override;
    [[nodiscard]] const identity& peer() const noexcept override { return peer_; }

  private:
    enum class state : std::uint8_t { fresh, open, finishing, closed };

    template <class F>
    void post_to_peer(F action);
    void receive(std::string lines);
    void consumed(std::size_t bytes);
    void on_other_finished();
    void on_other_closed();
    void hand_over();
    void hand_over_batch();
    void hand_over_lines();
    void continue_later();
    bool next_text();
    void release(std::size_t bytes);
    void discard_input();
    void wait_for_peer_close();
    void lose_later();
    void lose();
    [[nodiscard]] bool drained() const noexcept { return read_at_ >= text_.size() && inbox_.empty(); }
    // This much may be in transit before it counts as unsent, like data in the buffers of a socket.
    [[nodiscard]] std::size_t on_its_way() const noexcept { return in_transit_ > room ? in_transit_ - room : 0; }

    static constexpr std::size_t room = 65536;

    boost::asio::any_io_executor executor_;
    identity peer_;
    limits bounds_;
    std::weak_ptr<inproc_link> other_; // reached through its mailbox only
    std::shared_ptr<mailbox> peer_mailbox_;
    std::shared_ptr<mailbox>
        own_mailbox_; // shut when this end closes: its context may be destroyed before the other end
    std::shared_ptr<link_events> owner_;
    boost::asio::steady_timer timeout_;
    std::string output_;
    std::size_t in_transit_ = 0; // passed to the other end, not yet read there
    std::deque<std::string> inbox_;
    std::string text_;        // the one being read
    std::size_t read_at_ = 0; // position in it
    std::uint64_t flushed_ = 0;
    std::uint64_t received_ = 0;
    state state_ = state::fresh;
    bool handing_ = false;
    bool posted_ = false;
    bool paused_ = false;
    bool ended_ = false; // the other end sends no more
    bool end_reported_ = false;
    bool peer_closed_ = false; // the other end is closed
    bool overlong_ = false;
};

} // namespace cles::transport
