// SPDX-License-Identifier: BSL-1.0
#include "transport/inproc.hpp"

#include <cles/error.hpp>

#include "transport/inproc_link.hpp"

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
class doorway : public std::enable_shared_from_this<doorway> {
  public:
    doorway(asio::any_io_executor executor, url address, const limits& bounds)
        : local(std::move(address)), executor_(std::move(executor)), bounds_(bounds) {}

    const url local;

    void open(std::function<void(link_ptr)> on_link) { on_link_ = std::move(on_link); }

    // The executor's context may go from now on.
    void shut() {
        const std::lock_guard lock{mutex_};
        executor_ = nullptr;
        on_link_ = nullptr;
    }

    // By any thread; false where the door has been shut.
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

// The listeners of the process by name; services may be made on several threads.
class doorways {
  public:
    bool add(const std::shared_ptr<doorway>& door) {
        const std::lock_guard lock{mutex_};
        auto& place = doors_[door->local.host];
        if (!place.expired()) {
            return false;
        }
        place = door;
        return true;
    }
    void remove(const std::shared_ptr<doorway>& door) {
        const std::lock_guard lock{mutex_};
        const auto found = doors_.find(door->local.host);
        if (found != doors_.end() && found->second.lock() == door) {
            doors_.erase(found);
        }
    }
    std::shared_ptr<doorway> find(const std::string& name) {
        const std::lock_guard lock{mutex_};
        const auto found = doors_.find(name);
        return found == doors_.end() ? nullptr : found->second.lock();
    }

  private:
    std::mutex mutex_;
    std::map<std::string, std::weak_ptr<doorway>> doors_;
};

doorways& all_doorways() {
    static doorways instance;
    return instance;
}

class inproc_acceptor final : public acceptor {
  public:
    explicit inproc_acceptor(std::shared_ptr<doorway> door) : door_(std::move(door)) {}
    ~inproc_acceptor() override { close(); }

    [[nodiscard]] url local() const override { return door_->local; }
    void start(std::function<void(link_ptr)> on_link) override { door_->open(std::move(on_link)); }
    void close() override {
        all_doorways().remove(door_);
        door_->shut();
    }

  private:
    std::shared_ptr<doorway> door_;
};

class inproc_transport final : public link_transport {
  public:
    [[nodiscard]] bool is_exposed(const url&) const override { return false; }

    std::unique_ptr<acceptor> listen(const asio::any_io_executor& executor, const url& where,
                                     const limits& bounds) override {
        auto door = std::make_shared<doorway>(executor, where, bounds);
        if (!all_doorways().add(door)) {
            throw boost::system::system_error{asio::error::address_in_use};
        }
        return std::make_unique<inproc_acceptor>(std::move(door));
    }

    std::function<void()> dial(const asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done) override {
        auto near = std::make_shared<inproc_link>(executor, to_string(where), bounds);
        const auto door = all_doorways().find(where.host);
        if (!door || !door->admit(near)) {
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

bool is_open(const std::string& name) { return all_doorways().find(name) != nullptr; }

std::unique_ptr<link_transport> make_inproc() { return std::make_unique<inproc_transport>(); }

} // namespace cles::transport
