; People who hand things to each other: grasp and place of the paper, and a handover from any hand to any other.
(define (domain hand_over)
  (:requirements :strips :typing :negative-preconditions :equality)
  (:types hand thing table - object
          human_hand robot_hand - hand)
  (:predicates
    (free ?e - hand)
    (on_table ?o - thing)
    (grasped ?e - hand ?o - thing)
    (placed ?o - thing ?p - table))

  (:action grasp
    :parameters (?e - hand ?o - thing)
    :precondition (and (free ?e) (on_table ?o))
    :effect (and (grasped ?e ?o) (not (free ?e)) (not (on_table ?o))))

  (:action place
    :parameters (?e - hand ?o - thing ?p - table)
    :precondition (grasped ?e ?o)
    :effect (and (placed ?o ?p) (on_table ?o) (free ?e) (not (grasped ?e ?o))))

  (:action handover
    :parameters (?e1 - hand ?o - thing ?e2 - hand)
    :precondition (and (grasped ?e1 ?o) (free ?e2) (not (= ?e1 ?e2)))
    :effect (and (not (grasped ?e1 ?o)) (free ?e1) (grasped ?e2 ?o) (not (free ?e2)))))
