// SPDX-License-Identifier: BSL-1.0
#include "transport/member_handler.hpp"
#include "transport/transports.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/error.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/system/system_error.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

namespace cles::transport {
namespace asio = boost::asio;

namespace {

/// Posts to an executor for objects that may outlive it.
///
/// Its owner shuts it before the executor's context is destroyed; after that, nothing is posted. Thread-safe.
class mailbox {
  public:
    explicit mailbox(asio::any_io_executor executor) : executor_(std::move(executor)) {}

    /// Calls `action` with the executor; returns false if the mailbox is shut.
    template <class F>
    bool use(F action) {
        const std::lock_guard lock{mutex_};
        if (!executor_) {
            return false;
        }
        action(executor_);
        return true;
    }

    /// Runs `action` on the executor, later; drops it if the mailbox is shut.
    template <class F>
    void post(F action) {
        use([&](const asio::any_io_executor& executor) { asio::post(executor, std::move(action)); });
    }

    void shut() {
        const std::lock_guard lock{mutex_};
        executor_ = nullptr;
    }

  private:
    std::mutex mutex_;
    asio::any_io_executor executor_;
};

/// One end of a link between two services of a process: what one flushes is passed to the other on its executor,
/// without a socket and without copying. The two may run on different threads; each end is used only on its own
/// executor.
class inproc_link final : public link, public std::enable_shared_from_this<inproc_link> {
  public:
    [[gnu::cold]] inproc_link(const asio::any_io_executor& executor, std::string address, const limits& bounds);
    inproc_link(const inproc_link&) = delete;
    inproc_link& operator=(const inproc_link&) = delete;
    ~inproc_link() override;

    /// Connects two ends.
    static void join(const std::shared_ptr<inproc_link>& a, const std::shared_ptr<inproc_link>& b);

    void start(std::shared_ptr<link_events> owner) override;
    std::string& output() override { return output_; }
    void flush() override;
    [[nodiscard]] std::size_t unsent() const noexcept override { return output_.size() + excess_in_transit(); }
    [[nodiscard]] std::uint64_t sent() const noexcept override { return flushed_ - excess_in_transit(); }
    [[nodiscard]] std::uint64_t received() const noexcept override { return received_; }
    void pause(bool stop) override;
    [[gnu::cold]] void finish() override;
    [[gnu::cold]] void close() override;
    [[nodiscard]] const identity& peer() const noexcept override { return peer_; }

  private:
    enum class state : std::uint8_t { fresh, open, finishing, closed };

    /// What one end tells the other, besides lines.
    struct notice {
        void (*tell)(inproc_link& other, std::size_t bytes);
        std::size_t bytes = 0;

        void operator()(inproc_link& other) const { tell(other, bytes); }
    };

    template <class F>
    void post_to_peer(F action);
    void receive(std::string lines);
    void consumed(std::size_t bytes);
    [[gnu::cold]] void on_other_finished();
    [[gnu::cold]] void on_other_closed();
    void hand_over();
    void hand_over_batch();
    void continue_later();
    void go_on();
    bool next_text();
    void release(std::size_t bytes);
    [[gnu::cold]] void discard_input();
    [[gnu::cold]] void wait_for_peer_close();
    [[gnu::cold]] void on_timeout(boost::system::error_code code);
    [[gnu::cold]] void lose_later();
    [[gnu::cold]] void lose();
    [[nodiscard]] bool drained() const noexcept { return read_at_ >= text_.size() && inbox_.empty(); }
    // This much may be in transit before it counts as unsent, like data in the buffers of a socket.
    [[nodiscard]] std::size_t excess_in_transit() const noexcept {
        return in_transit_ > capacity ? in_transit_ - capacity : 0;
    }

    static constexpr std::size_t capacity = 65536;

    identity peer_;
    limits bounds_;
    std::weak_ptr<inproc_link> other_; // reached through its mailbox only
    std::shared_ptr<mailbox> peer_mailbox_;
    // Shut when this end closes: its context may be destroyed before the other end.
    std::shared_ptr<mailbox> own_mailbox_;
    std::shared_ptr<link_events> owner_;
    asio::steady_timer timeout_;
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

inproc_link::inproc_link(const asio::any_io_executor& executor, std::string address, const limits& bounds)
    : peer_{.transport = "inproc", .address = std::move(address), .name = {}, .uid = {}, .local = true},
      bounds_(bounds), own_mailbox_(std::make_shared<mailbox>(executor)), timeout_(executor) {}

inproc_link::~inproc_link() { inproc_link::close(); }

void inproc_link::join(const std::shared_ptr<inproc_link>& a, const std::shared_ptr<inproc_link>& b) {
    a->other_ = b;
    b->other_ = a;
    a->peer_mailbox_ = b->own_mailbox_;
    b->peer_mailbox_ = a->own_mailbox_;
}

template <class F>
void inproc_link::post_to_peer(F action) {
    if (!peer_mailbox_) {
        return;
    }
    peer_mailbox_->post([weak = other_, action = std::move(action)]() mutable {
        if (const auto other = weak.lock()) {
            action(*other);
        }
    });
}

void inproc_link::start(std::shared_ptr<link_events> owner) {
    if (state_ == state::closed) {
        return;
    }
    owner_ = std::move(owner);
    if (state_ == state::fresh) {
        state_ = state::open;
    }
    peer_closed_ = peer_closed_ || other_.expired();
    if (!inbox_.empty() || ended_ || peer_closed_) {
        continue_later();
    }
}

// -- writing -------------------------------------------------------------------------------------------------------

void inproc_link::flush() {
    if (state_ == state::closed || state_ == state::finishing || output_.empty()) {
        return;
    }
    if (peer_closed_) { // reported later: the owner may be in the middle of something
        output_.clear();
        lose_later();
        return;
    }
    in_transit_ += output_.size();
    flushed_ += output_.size();
    post_to_peer([lines = std::exchange(output_, {})](inproc_link& other) mutable { other.receive(std::move(lines)); });
}

void inproc_link::consumed(std::size_t bytes) {
    const bool was_full = excess_in_transit() != 0;
    in_transit_ -= bytes;
    if (!was_full || excess_in_transit() != 0) {
        return;
    }
    if (state_ == state::finishing) {
        wait_for_peer_close();
    } else if (const auto owner = owner_) {
        owner->on_writable();
    }
}

// -- reading -------------------------------------------------------------------------------------------------------

void inproc_link::receive(std::string lines) {
    if (state_ == state::closed) {
        return;
    }
    received_ += lines.size();
    if (state_ == state::finishing || overlong_) {
        release(lines.size());
        return;
    }
    inbox_.push_back(std::move(lines));
    hand_over();
}

// Notifies the other end that this much has been read.
void inproc_link::release(std::size_t bytes) {
    if (bytes != 0 && state_ != state::closed) {
        post_to_peer(notice{[](inproc_link& other, std::size_t read) { other.consumed(read); }, bytes});
    }
}

void inproc_link::discard_input() {
    if (handing_) {
        return; // a line of it is being processed further up the stack
    }
    auto bytes = text_.size();
    for (const auto& text : inbox_) {
        bytes += text.size();
    }
    inbox_.clear();
    text_.clear();
    read_at_ = 0;
    release(bytes);
}

// Makes the next text the current one. Returns false if none is left.
bool inproc_link::next_text() {
    if (read_at_ < text_.size()) {
        return true;
    }
    release(text_.size());
    text_.clear();
    read_at_ = 0;
    if (inbox_.empty()) {
        std::string{}.swap(text_); // frees its memory
        return false;
    }
    text_ = std::move(inbox_.front());
    inbox_.pop_front();
    return true;
}

void inproc_link::hand_over_batch() {
    const auto owner = owner_;
    for (int turn = lines_per_turn; turn > 0 && !paused_ && !overlong_ && state_ == state::open && next_text();
         --turn) {
        const auto end = std::min(text_.find('\n', read_at_), text_.size());
        const auto line = std::string_view{text_}.substr(read_at_, end - read_at_);
        if (line.size() > bounds_.line) {
            overlong_ = true;
            owner->on_overlong(line.substr(0, bounds_.line));
        } else {
            read_at_ = std::min(end + 1, text_.size());
            owner->on_line(line);
        }
    }
    if (state_ == state::open && ended_ && !end_reported_ && !overlong_ && !paused_ && drained()) {
        end_reported_ = true;
        owner->on_end();
    }
    if (state_ != state::closed) {
        owner->on_batch();
    }
}

void inproc_link::hand_over() {
    if (handing_ || state_ != state::open || !owner_) {
        return;
    }
    const auto self = shared_from_this();
    handing_ = true;
    try {
        hand_over_batch();
    } catch (...) { // of a handler, for the thread that runs the context; the other lines are not affected
        handing_ = false;
        continue_later();
        throw;
    }
    handing_ = false;
    if (state_ != state::open || overlong_) {
        discard_input();
    } else if (!paused_ && !drained()) {
        continue_later();
    } else if (drained()) {
        next_text(); // releases the last one
    }
    if (peer_closed_ && state_ == state::open && (overlong_ || (!paused_ && drained()))) {
        lose();
    }
}

void inproc_link::continue_later() {
    if (!posted_) {
        posted_ = true;
        post_call<&inproc_link::go_on>(timeout_.get_executor(), shared_from_this());
    }
}

void inproc_link::go_on() {
    posted_ = false;
    if (state_ == state::open) {
        hand_over();
    } else if (state_ == state::finishing) {
        discard_input();
    }
}

void inproc_link::pause(bool stop) {
    if (paused_ != stop) {
        paused_ = stop;
        if (!stop && !handing_) {
            continue_later();
        }
    }
}

// -- ending --------------------------------------------------------------------------------------------------------

void inproc_link::finish() {
    if (state_ == state::closed || state_ == state::finishing) {
        return;
    }
    flush();
    state_ = state::finishing;
    discard_input();
    post_to_peer(notice{[](inproc_link& other, std::size_t) { other.on_other_finished(); }});
    if (ended_ || peer_closed_) {
        lose_later();
    } else if (excess_in_transit() == 0) {
        wait_for_peer_close();
    }
}

void inproc_link::wait_for_peer_close() {
    timeout_.expires_after(bounds_.discard);
    wait_call<&inproc_link::on_timeout>(timeout_, shared_from_this());
}

void inproc_link::on_timeout(boost::system::error_code code) {
    if (!code) {
        lose();
    }
}

void inproc_link::on_other_finished() {
    ended_ = true;
    if (state_ == state::finishing) {
        lose_later();
    } else {
        hand_over();
    }
}

// What the other end sent before it closed is still delivered, unless that could take for ever.
void inproc_link::on_other_closed() {
    peer_closed_ = true;
    const bool held_back = paused_ && unsent() != 0;
    if (state_ == state::finishing || (state_ == state::open && (overlong_ || held_back))) {
        lose();
    } else {
        hand_over();
    }
}

void inproc_link::lose_later() { post_call<&inproc_link::lose>(timeout_.get_executor(), shared_from_this()); }

void inproc_link::lose() {
    if (state_ == state::closed) {
        return;
    }
    const auto owner = owner_;
    close();
    if (owner) {
        owner->on_lost(asio::error::eof);
    }
}

void inproc_link::close() {
    if (state_ == state::closed) {
        return;
    }
    state_ = state::closed;
    timeout_.cancel();
    discard_input();
    owner_.reset();
    own_mailbox_->shut();
    post_to_peer(notice{[](inproc_link& other, std::size_t) { other.on_other_closed(); }});
}

// -- the transport -------------------------------------------------------------------------------------------------

class inproc_acceptor;

// The listeners of the process by name; services may be created on several threads.
class inproc_listeners {
  public:
    bool add(const std::string& name, const std::shared_ptr<inproc_acceptor>& listener) {
        const std::lock_guard lock{mutex_};
        return listeners_.emplace(name, listener).second;
    }
    void remove(const std::string& name, const inproc_acceptor* listener) {
        const std::lock_guard lock{mutex_};
        const auto found = listeners_.find(name);
        if (found != listeners_.end() && found->second.get() == listener) {
            listeners_.erase(found);
        }
    }
    std::shared_ptr<inproc_acceptor> find(const std::string& name) {
        const std::lock_guard lock{mutex_};
        const auto found = listeners_.find(name);
        return found == listeners_.end() ? nullptr : found->second;
    }

  private:
    std::mutex mutex_;
    std::map<std::string, std::shared_ptr<inproc_acceptor>> listeners_;
};

inproc_listeners& all_inproc_listeners() {
    static auto& instance = *new inproc_listeners; // services in static objects use it until they are destroyed
    return instance;
}

// Where dialling threads leave their links.
class inproc_acceptor final : public acceptor, public std::enable_shared_from_this<inproc_acceptor> {
  public:
    inproc_acceptor(const asio::any_io_executor& executor, url where, const limits& bounds)
        : where_(std::move(where)), mailbox_(executor), bounds_(bounds) {}

    [[nodiscard]] url local() const override { return where_; }
    void start(std::function<void(link_ptr)> on_link) override { on_link_ = std::move(on_link); }
    // From now on, the executor's context may be destroyed.
    [[gnu::cold]] void close() override {
        all_inproc_listeners().remove(where_.host, this);
        mailbox_.shut();
        on_link_ = nullptr;
    }

    // Called on any thread. Returns false if it has been shut.
    [[gnu::cold]] bool admit(const std::shared_ptr<inproc_link>& near) {
        return mailbox_.use([&](const asio::any_io_executor& executor) {
            auto far = std::make_shared<inproc_link>(executor, to_string(where_), bounds_);
            inproc_link::join(near, far);
            asio::post(executor, [self = shared_from_this(), far] { self->come_in(far); });
        });
    }

  private:
    void come_in(link_ptr arrived) {
        if (!on_link_) {
            arrived->close();
        } else {
            on_link_(std::move(arrived));
        }
    }

    const url where_;
    mailbox mailbox_;
    limits bounds_;
    std::function<void(link_ptr)> on_link_; // used on the executor only
};

/// The result of dialling, which is reported later.
class dialled_link {
  public:
    dialled_link(std::shared_ptr<inproc_link> made, dial_callback done)
        : made_(std::move(made)), done_(std::move(done)) {}

    [[gnu::cold]] void report() {
        const auto made = std::exchange(made_, nullptr);
        if (const auto done = std::exchange(done_, nullptr)) {
            done(made ? boost::system::error_code{} : asio::error::connection_refused, made);
        } else if (made) {
            made->close();
        }
    }
    /// It is closed instead.
    void give_up() { done_ = nullptr; }

  private:
    std::shared_ptr<inproc_link> made_; // null: refused
    dial_callback done_;                // empty: given up
};

class inproc_transport final : public link_transport {
  public:
    [[nodiscard]] bool is_exposed(const url&) const override { return false; }

    [[gnu::cold]] std::unique_ptr<acceptor> listen(const asio::any_io_executor& executor, const url& where,
                                                   const limits& bounds) override {
        auto listener = std::make_shared<inproc_acceptor>(executor, where, bounds);
        if (!all_inproc_listeners().add(where.host, listener)) {
            throw boost::system::system_error{asio::error::address_in_use};
        }
        return handle_of(std::move(listener));
    }

    [[gnu::cold]] std::function<void()> dial(const asio::any_io_executor& executor, const url& where,
                                             const limits& bounds, dial_callback done) override {
        auto near = std::make_shared<inproc_link>(executor, to_string(where), bounds);
        const auto listener = all_inproc_listeners().find(where.host);
        if (!listener || !listener->admit(near)) {
            near->close();
            near.reset();
        }
        const auto result = std::make_shared<dialled_link>(std::move(near), std::move(done));
        post_call<&dialled_link::report>(executor, result);
        return [weak = std::weak_ptr{result}] { // the context owns the link, and may be destroyed first
            if (const auto pending = weak.lock()) {
                pending->give_up();
            }
        };
    }
};

} // namespace

bool is_open(const std::string& name) { return all_inproc_listeners().find(name) != nullptr; }

std::unique_ptr<link_transport> make_inproc() { return std::make_unique<inproc_transport>(); }

} // namespace cles::transport
