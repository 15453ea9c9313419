; A box that needs both hands. `lift` and `put` are new: their geometry is in carry_with_both_hands.py.
(define (domain two_hands)
  (:requirements :strips :typing :equality)
  (:types hand thing table - object
          human_hand robot_hand - hand)
  (:predicates
    (free ?e - hand)
    (on_table ?o - thing)
    (grasped ?e - hand ?o - thing)
    (placed ?o - thing ?p - table))

  (:action lift
    :parameters (?l - human_hand ?o - thing ?r - human_hand)
    :precondition (and (free ?l) (free ?r) (on_table ?o) (not (= ?l ?r)))
    :effect (and (grasped ?l ?o) (not (free ?l)) (not (free ?r)) (not (on_table ?o))))

  (:action put
    :parameters (?l - human_hand ?o - thing ?r - human_hand ?p - table)
    :precondition (and (grasped ?l ?o) (not (= ?l ?r)))
    :effect (and (placed ?o ?p) (on_table ?o) (not (grasped ?l ?o)) (free ?l) (free ?r))))
