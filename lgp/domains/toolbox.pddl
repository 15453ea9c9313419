; Assembling a toolbox: a robot brings the parts, the human stands them up and screws them together.
; Source: Busch, Toussaint & Lopes (2018), sections II.A and IV: grasp, place, handover, hold and screw as printed.
; Which hands may do what is in the types: a vacuum gripper lifts parts and gives them to the human but cannot stand
; them up; a parallel gripper is too narrow to lift them flat but holds them by an edge; only the human places and
; screws. Added to what is printed, each line marked "beyond the paper":
;   - a part that is held or screwed on is not taken away (the paper's short task never tries);
;   - only parts that the scene says are made for each other are screwed together;
;   - a hand that held may let go once the screw is in (the paper's task ends there).
(define (domain toolbox)
  (:requirements :strips :typing :negative-preconditions)
  (:types hand thing table - object
          human_hand robot_hand - hand
          vacuum_gripper parallel_gripper - robot_hand)
  (:predicates
    (free ?e - hand)
    (on_table ?o - thing)
    (grasped ?e - hand ?o - thing)
    (placed ?o - thing ?p - table)
    (held ?o - thing)
    (screwed ?o1 - thing ?o2 - thing)
    (holding ?e - hand ?o - thing)    ; beyond the paper: which hand holds
    (fixed ?o - thing)                ; beyond the paper: screwed to something
    (fit ?o1 - thing ?o2 - thing))    ; beyond the paper: made for each other

  ; at time t, the end-effector e (robot or human) grasps the object o
  (:action grasp
    :parameters (?e - (either human_hand vacuum_gripper) ?o - thing)
    :precondition (and (free ?e) (on_table ?o)
                       (not (held ?o)) (not (fixed ?o)))   ; beyond the paper
    :effect (and (grasped ?e ?o) (not (free ?e)) (not (on_table ?o))))

  ; at time t, the end-effector e (human) places the object o on table p
  (:action place
    :parameters (?e - human_hand ?o - thing ?p - table)
    :precondition (grasped ?e ?o)
    :effect (and (placed ?o ?p) (not (grasped ?e ?o)) (free ?e) (on_table ?o)))

  ; at time t, the end-effector e1 (robot) hands over object o to the end-effector e2 (human)
  (:action handover
    :parameters (?e1 - vacuum_gripper ?o - thing ?e2 - human_hand)
    :precondition (and (grasped ?e1 ?o) (free ?e2))
    :effect (and (not (grasped ?e1 ?o)) (free ?e1) (grasped ?e2 ?o) (not (free ?e2))))

  ; at time t, the end-effector e (robot or human) holds object o
  (:action hold
    :parameters (?e - (either human_hand parallel_gripper) ?o - thing)
    :precondition (and (on_table ?o) (free ?e))
    :effect (and (held ?o) (not (free ?e))
                 (holding ?e ?o)))                         ; beyond the paper

  ; at time t, the end-effector e (human) screws objects o1 and o2 together
  (:action screw
    :parameters (?e - human_hand ?o1 - thing ?o2 - thing)
    :precondition (and (on_table ?o1) (on_table ?o2) (free ?e) (held ?o1)
                       (fit ?o1 ?o2))                      ; beyond the paper
    :effect (and (screwed ?o1 ?o2) (not (held ?o1))
                 (fixed ?o1) (fixed ?o2)))                 ; beyond the paper

  ; beyond the paper: at time t, the end-effector e lets go of object o, whose screw is in
  (:action release
    :parameters (?e - hand ?o - thing)
    :precondition (and (holding ?e ?o) (not (held ?o)))
    :effect (and (free ?e) (not (holding ?e ?o)))))
