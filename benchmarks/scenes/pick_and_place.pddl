; Robots take things, put them down and pass them to each other; all geometry is that of shipped actions.
(define (domain pick_and_place)
  (:requirements :strips :typing :equality)
  (:types hand thing table - object robot_hand - hand)
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
    :effect (and (placed ?o ?p) (not (grasped ?e ?o)) (free ?e) (on_table ?o)))

  (:action handover
    :parameters (?e1 - hand ?o - thing ?e2 - hand)
    :precondition (and (grasped ?e1 ?o) (free ?e2) (not (= ?e1 ?e2)))
    :effect (and (grasped ?e2 ?o) (not (free ?e2)) (not (grasped ?e1 ?o)) (free ?e1))))
