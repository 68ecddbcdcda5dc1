// SPDX-License-Identifier: BSL-1.0
#include "support/fault_transport.hpp"

#include <cles/link.hpp>

#include <boost/asio/error.hpp>
#include <boost/asio/post.hpp>

#include <memory>
#include <string>
#include <utility>

namespace cles::test {

namespace asio = boost::asio;

std::ostream& operator<<(std::ostream& out, fault kind) {
    switch (kind) {
    case fault::lost: return out << "lost";
    case fault::cut: return out << "cut";
    case fault::ended: return out << "ended";
    }
    return out;
}

fault_plan& fault_plan::instance() {
    static fault_plan plan;
    return plan;
}

void fault_plan::arm(fault how, int step) {
    how_ = how;
    step_ = step;
    count_ = 0;
    struck_ = false;
}

bool fault_plan::strikes() {
    const bool now = count_++ == step_;
    struck_ = struck_ || now;
    return now;
}

/// An end of a link that may fail; forwards everything else to the link inside.
class faulty_link final : public link, public link_events, public std::enable_shared_from_this<faulty_link> {
  public:
    faulty_link(asio::any_io_executor executor, link_ptr inside)
        : executor_(std::move(executor)), inside_(std::move(inside)) {
        ++plan_.links_;
    }
    ~faulty_link() override { --plan_.links_; }

    void start(std::shared_ptr<link_events> owner) override {
        owner_ = std::move(owner);
        inside_->start(shared_from_this());
        if (plan_.strikes()) {
            fail();
        }
    }
    std::string& output() override { return inside_->output(); }
    void flush() override {
        if (inside_->output().empty() || silent_) {
            inside_->output().clear();
            return;
        }
        if (!plan_.strikes()) {
            inside_->flush();
            return;
        }
        if (plan_.how() == fault::cut) { // whole lines, as on this kind of link
            auto& text = inside_->output();
            text.erase(text.rfind('\n', text.size() / 2) + 1);
            inside_->flush();
        } else {
            inside_->output().clear();
        }
        fail();
    }
    [[nodiscard]] std::size_t unsent() const noexcept override { return inside_->unsent(); }
    [[nodiscard]] std::uint64_t sent() const noexcept override { return inside_->sent(); }
    [[nodiscard]] std::uint64_t received() const noexcept override { return inside_->received(); }
    void pause(bool stop) override { inside_->pause(stop); }
    void finish() override {
        finished_ = true;
        inside_->finish();
    }
    void close() override {
        silent_ = true;
        inside_->close();
        owner_.reset();
    }
    [[nodiscard]] const identity& peer() const noexcept override { return inside_->peer(); }

    void on_line(std::string_view line) override {
        const auto owner = owner_;
        if (silent_ || ended_ || !owner) {
            return;
        }
        if (!plan_.strikes()) {
            owner->on_line(line);
        } else if (plan_.how() == fault::ended) {
            ended_ = true;
            owner->on_end();
            lose_if_kept();
        } else {
            fail();
        }
    }
    void on_overlong(std::string_view head) override {
        if (const auto owner = owner_; owner && !ended_) {
            owner->on_overlong(head);
        }
    }
    void on_batch() override {
        if (const auto owner = owner_) {
            owner->on_batch();
        }
    }
    void on_end() override {
        if (const auto owner = owner_; owner && !ended_) {
            ended_ = true;
            owner->on_end();
        }
    }
    void on_lost(boost::system::error_code why) override {
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
    void fail() {
        silent_ = true;
        lose_later();
    }
    void lose_later() {
        asio::post(executor_, [self = shared_from_this()] {
            self->inside_->close();
            self->on_lost(asio::error::connection_reset);
        });
    }
    // What this end sends before the end of stream still arrives. But the other end has not ended its side, so what it
    // writes from then on would reset the link, as would what it has just written.
    void lose_if_kept() {
        asio::post(executor_, [self = shared_from_this()] {
            if (!self->finished_ && !self->silent_) {
                self->lose_later();
            }
        });
    }

    fault_plan& plan_ = fault_plan::instance();
    asio::any_io_executor executor_;
    link_ptr inside_;
    std::shared_ptr<link_events> owner_{};
    bool silent_ = false; // nothing gets through any more
    bool ended_ = false;
    bool finished_ = false; // by this end
};

namespace {

url inner_address(const url& where) {
    return {.scheme = "inproc", .host = "fault/" + where.host, .port = 0, .path = {}};
}

class faulty_acceptor final : public acceptor {
  public:
    faulty_acceptor(asio::any_io_executor executor, std::unique_ptr<acceptor> inside, url where)
        : executor_(std::move(executor)), inside_(std::move(inside)), where_(std::move(where)) {}

    [[nodiscard]] url local() const override { return where_; }
    void start(std::function<void(link_ptr)> on_link) override {
        inside_->start([executor = executor_, on_link = std::move(on_link)](link_ptr arrived) {
            if (fault_plan::instance().strikes()) {
                arrived->close();
            } else {
                on_link(std::make_shared<faulty_link>(executor, std::move(arrived)));
            }
        });
    }
    void accept_waiting() override { inside_->accept_waiting(); }
    void close() override { inside_->close(); }

  private:
    asio::any_io_executor executor_;
    std::unique_ptr<acceptor> inside_;
    url where_;
};

class fault_transport final : public link_transport {
  public:
    [[nodiscard]] bool is_exposed(const url&) const override { return false; }

    std::unique_ptr<acceptor> listen(const asio::any_io_executor& executor, const url& where,
                                     const limits& bounds) override {
        return std::make_unique<faulty_acceptor>(
            executor, find_transport("inproc")->listen(executor, inner_address(where), bounds), where);
    }

    std::function<void()> dial(const asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done) override {
        auto address = inner_address(where);
        if (fault_plan::instance().strikes()) {
            address.host = "nobody/listens/here";
        }
        return find_transport("inproc")->dial(
            executor, address, bounds,
            [executor, done = std::move(done)](boost::system::error_code failed, link_ptr made) {
                done(failed, made ? std::make_shared<faulty_link>(executor, std::move(made)) : nullptr);
            });
    }
};

} // namespace

void register_fault_transport() {
    if (find_transport("fault") == nullptr) {
        register_transport("fault", std::make_unique<fault_transport>());
    }
}

} // namespace cles::test
