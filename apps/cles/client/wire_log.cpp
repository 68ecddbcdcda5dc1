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

constexpr std::size_t max_shown = 4096; // of a line; what is more is only counted

/// Passes everything on to the link inside, and logs the lines.
class logged_link final : public cles::link,
                          public cles::link_events,
                          public std::enable_shared_from_this<logged_link> {
  public:
    logged_link(cles::link_ptr inside, std::string where, cles::log_sink log)
        : inside_(std::move(inside)), where_(std::move(where)), log_(std::move(log)) {}

    void start(std::shared_ptr<cles::link_events> owner) override {
        owner_ = std::move(owner);
        inside_->start(shared_from_this());
    }
    // Kept here until it is flushed, so that each line is logged once.
    std::string& output() override { return output_; }
    std::string& urgent_output() override { return urgent_; }
    [[nodiscard]] std::size_t datagram() const noexcept override { return inside_->datagram(); }
    void flush() override {
        hand_over();
        inside_->flush();
    }
    [[nodiscard]] std::size_t unsent() const noexcept override {
        return inside_->unsent() + output_.size() + urgent_.size();
    }
    [[nodiscard]] std::uint64_t sent() const noexcept override { return inside_->sent(); }
    [[nodiscard]] std::uint64_t received() const noexcept override { return inside_->received(); }
    [[nodiscard]] std::size_t buffered() const noexcept override {
        return inside_->buffered() + output_.capacity() + urgent_.capacity();
    }
    void shrink() override {
        for (auto* waiting : {&output_, &urgent_}) {
            if (waiting->empty()) {
                std::string{}.swap(*waiting);
            }
        }
        inside_->shrink();
    }
    void pause(bool stop) override { inside_->pause(stop); }
    void finish() override {
        hand_over();
        inside_->finish();
    }
    void close() override {
        say("-", "closed");
        inside_->close();
        owner_.reset();
    }
    [[nodiscard]] const cles::identity& peer() const noexcept override { return inside_->peer(); }

    void on_line(std::string_view line) override {
        say("<", line);
        if (const auto owner = owner_) {
            owner->on_line(line);
        }
    }
    void on_overlong(std::string_view head) override {
        say("<", head);
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
        say("<", part);
        if (const auto owner = owner_) {
            owner->on_cut(part);
        }
    }
    void on_end() override {
        say("-", "the peer sends no more");
        if (const auto owner = owner_) {
            owner->on_end();
        }
    }
    void on_lost(boost::system::error_code why) override {
        say("-", "lost: " + why.message());
        if (const auto owner = std::exchange(owner_, nullptr)) {
            owner->on_lost(why);
        }
    }
    void on_room() override {
        if (const auto owner = owner_) {
            owner->on_room();
        }
    }

  private:
    void say(std::string_view direction, std::string_view text) {
        std::string entry{direction};
        entry.append(" ").append(where_).append(" ").append(text.substr(0, max_shown));
        if (text.size() > max_shown) {
            entry.append("... and " + std::to_string(text.size() - max_shown) + " more bytes");
        }
        log_(cles::log_level::debug, entry);
    }
    void move_lines(std::string& from, std::string& to) {
        for (std::size_t at = 0; at < from.size();) {
            const auto end = std::min(from.find('\n', at), from.size());
            say(">", std::string_view{from}.substr(at, end - at));
            at = end + 1;
        }
        if (to.empty()) {
            to.swap(from);
        } else {
            to += from;
            from.clear();
        }
    }
    void hand_over() {
        move_lines(urgent_, inside_->urgent_output());
        move_lines(output_, inside_->output());
    }

    cles::link_ptr inside_;
    std::string where_;
    cles::log_sink log_;
    std::shared_ptr<cles::link_events> owner_;
    std::string output_;
    std::string urgent_;
};

class logged_acceptor final : public cles::acceptor {
  public:
    logged_acceptor(std::unique_ptr<cles::acceptor> inside, cles::log_sink log)
        : inside_(std::move(inside)), log_(std::move(log)) {}

    [[nodiscard]] cles::url local() const override { return inside_->local(); }
    void start(std::function<void(cles::link_ptr)> on_link) override {
        inside_->start([log = log_, on_link = std::move(on_link)](cles::link_ptr arrived) {
            const auto where = arrived->peer().address;
            on_link(std::make_shared<logged_link>(std::move(arrived), where, log));
        });
    }
    void accept_waiting() override { inside_->accept_waiting(); }
    void close() override { inside_->close(); }

  private:
    std::unique_ptr<cles::acceptor> inside_;
    cles::log_sink log_;
};

class logged_transport final : public cles::link_transport {
  public:
    explicit logged_transport(cles::log_sink log) : log_(std::move(log)) {}
    void wrap(std::unique_ptr<cles::link_transport> inside) { inside_ = std::move(inside); }

    [[nodiscard]] bool is_exposed(const cles::url& where) const override { return inside_->is_exposed(where); }
    std::unique_ptr<cles::acceptor> listen(const asio::any_io_executor& executor, const cles::url& where,
                                           const cles::limits& bounds) override {
        return std::make_unique<logged_acceptor>(inside_->listen(executor, where, bounds), log_);
    }
    std::function<void()> dial(const asio::any_io_executor& executor, const cles::url& where,
                               const cles::limits& bounds, cles::dial_callback done) override {
        return inside_->dial(executor, where, bounds,
                             [where = to_string(where), log = log_,
                              done = std::move(done)](boost::system::error_code failed, cles::link_ptr made) {
                                 if (made) {
                                     made = std::make_shared<logged_link>(std::move(made), where, log);
                                 }
                                 done(failed, std::move(made));
                             });
    }

  private:
    std::unique_ptr<cles::link_transport> inside_;
    cles::log_sink log_;
};

} // namespace

cles::link_ptr logged(cles::link_ptr inside, std::string where, cles::log_sink log) {
    return std::make_shared<logged_link>(std::move(inside), std::move(where), std::move(log));
}

void log_wire(const cles::log_sink& log) {
    for (const auto* scheme : {"tcp", "udp", "unix"}) {
        auto logged = std::make_unique<logged_transport>(log);
        auto& outside = *logged;
        outside.wrap(cles::register_transport(scheme, std::move(logged)));
    }
}

} // namespace tool
