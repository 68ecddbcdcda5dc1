// SPDX-License-Identifier: BSL-1.0
#include "client/wire_log.hpp"

#include <cles/link.hpp>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace tool {
namespace {

namespace asio = boost::asio;

constexpr std::size_t max_shown = 4096; // bytes of a line; the rest is only counted

/// Forwards everything to the inner link, and logs the lines.
class logged_link final : public cles::link,
                          public cles::link_events,
                          public std::enable_shared_from_this<logged_link> {
  public:
    logged_link(cles::link_ptr inner, std::string address, cles::log_sink log)
        : inner_(std::move(inner)), address_(std::move(address)), log_(std::move(log)) {}

    void start(std::shared_ptr<cles::link_events> owner) override {
        owner_ = std::move(owner);
        inner_->start(shared_from_this());
    }
    // Buffered here until it is flushed, so that each line is logged once.
    std::string& output() override { return output_; }
    std::string& urgent_output() override { return urgent_; }
    [[nodiscard]] std::size_t datagram() const noexcept override { return inner_->datagram(); }
    void flush() override {
        forward_output();
        inner_->flush();
    }
    [[nodiscard]] std::size_t unsent() const noexcept override {
        return inner_->unsent() + output_.size() + urgent_.size();
    }
    [[nodiscard]] std::uint64_t sent() const noexcept override { return inner_->sent(); }
    [[nodiscard]] std::uint64_t received() const noexcept override { return inner_->received(); }
    [[nodiscard]] std::size_t buffered() const noexcept override {
        return inner_->buffered() + output_.capacity() + urgent_.capacity();
    }
    void shrink() override {
        for (auto* buffer : {&output_, &urgent_}) {
            if (buffer->empty()) {
                std::string{}.swap(*buffer);
            }
        }
        inner_->shrink();
    }
    void pause(bool stop) override { inner_->pause(stop); }
    void finish() override {
        forward_output();
        inner_->finish();
    }
    void close() override {
        log_line("-", "closed");
        inner_->close();
        owner_.reset();
    }
    [[nodiscard]] const cles::identity& peer() const noexcept override { return inner_->peer(); }
    [[nodiscard]] std::string_view epoch() const noexcept override { return inner_->epoch(); }

    void on_line(std::string_view line) override {
        log_line("<", line);
        if (const auto owner = owner_) {
            owner->on_line(line);
        }
    }
    void on_overlong(std::string_view head) override {
        log_line("<", head);
        if (const auto owner = owner_) {
            owner->on_overlong(head);
        }
    }
    void on_batch() override {
        if (const auto owner = owner_) {
            owner->on_batch();
        }
    }
    void on_cut(std::string_view part) override {
        log_line("<", part);
        if (const auto owner = owner_) {
            owner->on_cut(part);
        }
    }
    void on_end() override {
        log_line("-", "the peer has finished sending");
        if (const auto owner = owner_) {
            owner->on_end();
        }
    }
    void on_lost(boost::system::error_code why) override {
        log_line("-", "lost: " + why.message());
        if (const auto owner = std::exchange(owner_, nullptr)) {
            owner->on_lost(why);
        }
    }
    void on_writable() override {
        if (const auto owner = owner_) {
            owner->on_writable();
        }
    }

  private:
    void log_line(std::string_view direction, std::string_view text) {
        std::string entry{direction};
        entry.append(" ").append(address_).append(" ").append(text.substr(0, max_shown));
        if (text.size() > max_shown) {
            entry.append("... and " + std::to_string(text.size() - max_shown) + " more bytes");
        }
        log_(cles::log_level::debug, entry);
    }
    void move_lines(std::string& from, std::string& to) {
        for (std::size_t at = 0; at < from.size();) {
            const auto end = std::min(from.find('\n', at), from.size());
            log_line(">", std::string_view{from}.substr(at, end - at));
            at = end + 1;
        }
        if (to.empty()) {
            to.swap(from);
        } else {
            to += from;
            from.clear();
        }
    }
    void forward_output() {
        move_lines(urgent_, inner_->urgent_output());
        move_lines(output_, inner_->output());
    }

    cles::link_ptr inner_;
    std::string address_;
    cles::log_sink log_;
    std::shared_ptr<cles::link_events> owner_;
    std::string output_;
    std::string urgent_;
};

class logged_acceptor final : public cles::acceptor {
  public:
    logged_acceptor(std::unique_ptr<cles::acceptor> inner, cles::log_sink log)
        : inner_(std::move(inner)), log_(std::move(log)) {}

    [[nodiscard]] cles::url local() const override { return inner_->local(); }
    void start(std::function<void(cles::link_ptr)> on_link) override {
        inner_->start([log = log_, on_link = std::move(on_link)](cles::link_ptr accepted) {
            const auto address = accepted->peer().address;
            on_link(std::make_shared<logged_link>(std::move(accepted), address, log));
        });
    }
    void accept_waiting() override { inner_->accept_waiting(); }
    void close() override { inner_->close(); }

  private:
    std::unique_ptr<cles::acceptor> inner_;
    cles::log_sink log_;
};

class logged_transport final : public cles::link_transport {
  public:
    explicit logged_transport(cles::log_sink log) : log_(std::move(log)) {}
    void wrap(std::unique_ptr<cles::link_transport> inner) { inner_ = std::move(inner); }

    [[nodiscard]] bool is_exposed(const cles::url& address) const override { return inner_->is_exposed(address); }
    std::unique_ptr<cles::acceptor> listen(const asio::any_io_executor& executor, const cles::url& address,
                                           const cles::limits& bounds) override {
        return std::make_unique<logged_acceptor>(inner_->listen(executor, address, bounds), log_);
    }
    std::function<void()> dial(const asio::any_io_executor& executor, const cles::url& address,
                               const cles::limits& bounds, cles::dial_callback done) override {
        return inner_->dial(executor, address, bounds,
                            [address = to_string(address), log = log_,
                             done = std::move(done)](boost::system::error_code failed, cles::link_ptr made) {
                                if (made) {
                                    made = std::make_shared<logged_link>(std::move(made), address, log);
                                }
                                done(failed, std::move(made));
                            });
    }

  private:
    std::unique_ptr<cles::link_transport> inner_;
    cles::log_sink log_;
};

} // namespace

cles::link_ptr logged(cles::link_ptr inner, std::string address, cles::log_sink log) {
    return std::make_shared<logged_link>(std::move(inner), std::move(address), std::move(log));
}

void log_wire(const cles::log_sink& log) {
    for (const auto* scheme : {"tcp", "udp", "unix"}) {
        auto logged = std::make_unique<logged_transport>(log);
        auto& outer = *logged;
        outer.wrap(cles::register_transport(scheme, std::move(logged)));
    }
}

} // namespace tool
