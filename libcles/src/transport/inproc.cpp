// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "transport/inproc_link.hpp"
#include "transport/transports.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/post.hpp>

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

namespace cles::transport {
namespace asio = boost::asio;

namespace {

// Where dialling threads leave their links for a listener.
class inproc_listener : public std::enable_shared_from_this<inproc_listener> {
  public:
    inproc_listener(asio::any_io_executor executor, url address, const limits& bounds)
        : local(std::move(address)), executor_(std::move(executor)), bounds_(bounds) {}

    const url local;

    void open(std::function<void(link_ptr)> on_link) { on_link_ = std::move(on_link); }

    // From now on, the executor's context may be destroyed.
    void shut() {
        const std::lock_guard lock{mutex_};
        executor_ = nullptr;
        on_link_ = nullptr;
    }

    // Called on any thread. Returns false if it has been shut.
    bool admit(const std::shared_ptr<inproc_link>& near) {
        const std::lock_guard lock{mutex_};
        if (!executor_) {
            return false;
        }
        auto far = std::make_shared<inproc_link>(executor_, to_string(local), bounds_);
        inproc_link::join(near, far);
        asio::post(executor_, [self = shared_from_this(), far] { self->come_in(far); });
        return true;
    }

  private:
    void come_in(link_ptr arrived) {
        if (!on_link_) {
            arrived->close();
        } else {
            on_link_(std::move(arrived));
        }
    }

    std::mutex mutex_;
    asio::any_io_executor executor_;
    limits bounds_;
    std::function<void(link_ptr)> on_link_; // used on the executor only
};

// The listeners of the process by name; services may be created on several threads.
class inproc_listeners {
  public:
    bool add(const std::shared_ptr<inproc_listener>& listener) {
        const std::lock_guard lock{mutex_};
        auto& place = listeners_[listener->local.host];
        if (!place.expired()) {
            return false;
        }
        place = listener;
        return true;
    }
    void remove(const std::shared_ptr<inproc_listener>& listener) {
        const std::lock_guard lock{mutex_};
        const auto found = listeners_.find(listener->local.host);
        if (found != listeners_.end() && found->second.lock() == listener) {
            listeners_.erase(found);
        }
    }
    std::shared_ptr<inproc_listener> find(const std::string& name) {
        const std::lock_guard lock{mutex_};
        const auto found = listeners_.find(name);
        return found == listeners_.end() ? nullptr : found->second.lock();
    }

  private:
    std::mutex mutex_;
    std::map<std::string, std::weak_ptr<inproc_listener>> listeners_;
};

inproc_listeners& all_inproc_listeners() {
    static inproc_listeners instance;
    return instance;
}

class inproc_acceptor final : public acceptor {
  public:
    explicit inproc_acceptor(std::shared_ptr<inproc_listener> listener) : listener_(std::move(listener)) {}
    ~inproc_acceptor() override { close(); }

    [[nodiscard]] url local() const override { return listener_->local; }
    void start(std::function<void(link_ptr)> on_link) override { listener_->open(std::move(on_link)); }
    void close() override {
        all_inproc_listeners().remove(listener_);
        listener_->shut();
    }

  private:
    std::shared_ptr<inproc_listener> listener_;
};

class inproc_transport final : public link_transport {
  public:
    [[nodiscard]] bool is_exposed(const url&) const override { return false; }

    std::unique_ptr<acceptor> listen(const asio::any_io_executor& executor, const url& where,
                                     const limits& bounds) override {
        auto listener = std::make_shared<inproc_listener>(executor, where, bounds);
        if (!all_inproc_listeners().add(listener)) {
            throw boost::system::system_error{asio::error::address_in_use};
        }
        return std::make_unique<inproc_acceptor>(std::move(listener));
    }

    std::function<void()> dial(const asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done) override {
        auto near = std::make_shared<inproc_link>(executor, to_string(where), bounds);
        const auto listener = all_inproc_listeners().find(where.host);
        if (!listener || !listener->admit(near)) {
            near->close();
            near.reset();
        }
        auto given_up = std::make_shared<bool>(false);
        asio::post(executor, [given_up, near, done = std::move(done)] {
            if (*given_up) {
                if (near) {
                    near->close();
                }
            } else if (near) {
                done({}, near);
            } else {
                done(asio::error::connection_refused, nullptr);
            }
        });
        return [given_up] { *given_up = true; };
    }
};

} // namespace

bool is_open(const std::string& name) { return all_inproc_listeners().find(name) != nullptr; }

std::unique_ptr<link_transport> make_inproc() { return std::make_unique<inproc_transport>(); }

} // namespace cles::transport
