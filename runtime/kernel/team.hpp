// Threads that share out numbered pieces of work, for as long as the team lives.
//
// Which thread does a piece is left to chance, so pieces must not depend on each other; what is added up is added up
// piece by piece afterwards.  Then results are the same for any number of threads.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace flexpara {

class Team {
   public:
    // threads: this one among them.
    explicit Team(int threads) {
        for (int i = 1; i < threads; ++i) helpers_.emplace_back([this] { help(); });
    }

    Team(const Team&) = delete;
    Team& operator=(const Team&) = delete;

    ~Team() {
        {
            std::lock_guard<std::mutex> lock(mutex_);
            over_ = true;
        }
        wake_.notify_all();
        for (auto& helper : helpers_) helper.join();
    }

    // work(0) … work(pieces − 1), in any order; returns when all are done.
    void each(int pieces, const std::function<void(int)>& work) {
        if (helpers_.empty() || pieces < 2) {
            for (int piece = 0; piece < pieces; ++piece) work(piece);
            return;
        }
        {
            std::lock_guard<std::mutex> lock(mutex_);
            work_ = &work, pieces_ = pieces, next_ = 0, busy_ = helpers_.size(), ++round_;
        }
        wake_.notify_all();
        take();
        std::unique_lock<std::mutex> lock(mutex_);
        done_.wait(lock, [this] { return busy_ == 0; });
    }

   private:
    void take() {
        for (int piece; (piece = next_++) < pieces_;) (*work_)(piece);
    }

    void help() {
        for (std::size_t seen = 0;;) {
            {
                std::unique_lock<std::mutex> lock(mutex_);
                wake_.wait(lock, [&] { return over_ || round_ != seen; });
                if (over_) return;
                seen = round_;
            }
            take();
            std::lock_guard<std::mutex> lock(mutex_);
            if (--busy_ == 0) done_.notify_one();
        }
    }

    std::vector<std::thread> helpers_;
    std::mutex mutex_;
    std::condition_variable wake_, done_;
    const std::function<void(int)>* work_ = nullptr;
    std::atomic<int> next_{0};
    int pieces_ = 0;
    std::size_t busy_ = 0, round_ = 0;
    bool over_ = false;
};

}  // namespace flexpara
