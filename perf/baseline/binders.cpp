// SPDX-License-Identifier: BSL-1.0
#include "binders.hpp"

#include "update_packet.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include <sys/epoll.h>
#include <sys/socket.h>

namespace cles::perf::icd {
namespace {

constexpr std::size_t packet_size = sizeof(update_packet);

/// False if nothing could be read.
bool has_come(ssize_t result, const char* attempted) {
    if (result < 0 && (errno == EAGAIN || errno == EINTR)) {
        return false;
    }
    checked(result, attempted);
    return true;
}

class binder {
  public:
    binder(descriptor socket, arrivals& all, std::uint64_t updates)
        : socket_(std::move(socket)), all_(all), updates_(updates) {}
    binder(const binder&) = delete;
    binder& operator=(const binder&) = delete;
    virtual ~binder() = default;

    [[nodiscard]] int socket() const noexcept { return socket_.get(); }
    [[nodiscard]] bool complete() const noexcept { return last_ == updates_; }
    /// Reads what has arrived, up to a limit.
    virtual void read() = 0;

  protected:
    void take(std::span<const std::byte> packet) {
        const auto update = unpack_update(packet);
        if (!update) {
            throw std::runtime_error("the hand-written publisher sent something that is not an update");
        }
        if (update->number > last_) { // otherwise a duplicate, or out of order
            last_ = update->number;
            all_.take(update->value);
        }
    }

  private:
    descriptor socket_;
    arrivals& all_;
    std::uint64_t updates_;
    std::uint64_t last_ = 0;
};

class stream_binder final : public binder {
  public:
    using binder::binder;

    void read() override {
        const auto got = ::recv(socket(), buffer_.data() + have_, buffer_.size() - have_, MSG_DONTWAIT);
        if (!has_come(got, "recv")) {
            return;
        }
        if (got == 0) {
            throw std::runtime_error("the hand-written publisher closed the connection");
        }
        have_ += static_cast<std::size_t>(got);
        std::size_t at = 0;
        for (; have_ - at >= packet_size; at += packet_size) {
            take(std::span{buffer_}.subspan(at, packet_size));
        }
        std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(at),
                  buffer_.begin() + static_cast<std::ptrdiff_t>(have_), buffer_.begin());
        have_ -= at;
    }

  private:
    std::array<std::byte, 16384> buffer_{};
    std::size_t have_ = 0;
};

class datagram_binder final : public binder {
  public:
    datagram_binder(descriptor socket, arrivals& all, std::uint64_t updates) : binder(std::move(socket), all, updates) {
        for (std::size_t i = 0; i < batch; ++i) {
            places_[i] = {.iov_base = packets_[i].data(), .iov_len = packet_size};
            headers_[i].msg_hdr.msg_iov = &places_[i];
            headers_[i].msg_hdr.msg_iovlen = 1;
        }
    }

    void read() override {
        const int got = ::recvmmsg(socket(), headers_.data(), batch, MSG_DONTWAIT, nullptr);
        if (!has_come(got, "recvmmsg")) {
            return;
        }
        for (std::size_t i = 0; i < static_cast<std::size_t>(got); ++i) {
            if (headers_[i].msg_len == packet_size) { // any program may send to the port of a group
                take(packets_[i]);
            }
        }
    }

  private:
    static constexpr std::size_t batch = 32;
    std::array<update_bytes, batch> packets_{};
    std::array<iovec, batch> places_{};
    std::array<mmsghdr, batch> headers_{};
};

void watch(const descriptor& poll, int socket, binder* of) {
    epoll_event event{.events = EPOLLIN, .data = {.ptr = of}};
    checked(::epoll_ctl(poll.get(), EPOLL_CTL_ADD, socket, &event), "epoll_ctl");
}

} // namespace

fan_out_tally binders::run(const fan_out_order& order, latency_recorder* record) {
    arrivals all{record};
    std::array<std::byte, 1> word{};
    const descriptor poll{checked(::epoll_create1(EPOLL_CLOEXEC), "epoll_create1")};
    std::vector<std::unique_ptr<binder>> watched;
    send_all(control_.get(), std::as_bytes(std::span{&order, 1}));
    for (std::uint64_t i = 0; i < order.binders; ++i) {
        if (group_) {
            watched.push_back(std::make_unique<datagram_binder>(join(*group_), all, order.updates));
        } else {
            watched.push_back(std::make_unique<stream_binder>(perf::connect_to(publisher_), all, order.updates));
        }
        watch(poll, watched.back()->socket(), watched.back().get());
    }
    watch(poll, control_.get(), nullptr);
    send_all(control_.get(), word);

    std::array<epoll_event, 64> events{};
    bool published = false;
    for (std::size_t complete = 0; complete < watched.size();) {
        const auto ready =
            ::epoll_wait(poll.get(), events.data(), events.size(), published ? static_cast<int>(silence.count()) : -1);
        if (ready < 0 && errno == EINTR) {
            continue;
        }
        if (checked(ready, "epoll_wait") == 0) {
            break;
        }
        for (std::size_t i = 0; i < static_cast<std::size_t>(ready); ++i) {
            auto* const from = static_cast<binder*>(events[i].data.ptr);
            if (from == nullptr) {
                published = receive_all(control_.get(), word);
                if (!published) {
                    throw std::runtime_error("the hand-written publisher closed the connection");
                }
                continue;
            }
            const bool was_complete = from->complete();
            from->read();
            complete += !was_complete && from->complete() ? 1U : 0U;
        }
    }
    if (!published) {
        receive_all(control_.get(), word);
    }
    return all.tally();
}

} // namespace cles::perf::icd
