;; A plug-in that does, when its job begins and at each timer, what a test puts in.
(module
  (@custom "softplug.manifest"
    "{\"abi\":\"1.0\",\"name\":\"NAME\",\"version\":\"1.0.0\",\"licence\":\"MIT\","
    "\"protocol\":\"none\",\"description\":\"Does as it is told.\","
    "\"jobs\":[{\"name\":\"send\",\"text\":\"Sends a program\"}]}")
  (memory (export "memory") 1 1)
  ;; The mailbox: 512 bytes in, 1,024 out, 64 for last words.
  (data (i32.const 16) "\00\04\00\00\00\02\00\00" "\00\08\00\00\00\04\00\00" "\40\00\00\00\40\00\00\00")
  ;; set-timer 0, at a time that is put in.
  (data (i32.const 2048) "\06\00\09\00" "\00")
  (func (export "softplug_v1") (result i32) (i32.const 16))
  (func (export "softplug_v1_step") (param $kind i32) (param $len i32) (param $now i64) (result i32)
    (if (i32.or (i32.eq (local.get $kind) (i32.const 14)) (i32.eq (local.get $kind) (i32.const 9))) (then
      HOW))
    (i32.const 0)))
